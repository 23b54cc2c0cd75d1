// What is written over the canvas: names of what is shown, legends, labels, scale bar, directions.

/**
 * Nodes are kept from frame to frame and only what differs is set: while the model turns that is a few transforms. Making them anew
 * took a third of a frame where the processor draws.
 */
class Annotations {
  constructor(viewer) {
    this.viewer = viewer;
    this.root = element('div', { class: 'overlay' });
    this.nodes = new Map();
  }

  update() {
    const { viewer } = this;
    const { stage, header } = viewer;
    const [whole, height] = [stage.clientWidth, stage.clientHeight];
    const width = whole / viewer.panes.length;
    const plane = viewer.plane();
    this.unused = new Set(this.nodes.keys());
    viewer.panes.forEach((pane, k) => {
      const put = (key, make, at) => {
        const [x, y] = viewer.place(at, k);
        if (x > k * width && x < (k + 1) * width && y > 0 && y < height) this.move(this.keep(`${key} ${k}`, make), x, y);
      };
      if (pane.labels) {
        header.labels.forEach((label, i) => {
          if (!plane || dot(label.at, plane) <= plane[3]) put(`label ${i}`, () => element('span', { class: 'label' }, label.text), label.at);
        });
      }
      if (viewer.marker) put('marker', () => element('span', { class: 'marker' }), viewer.marker);
      const shown = header.surfaces.filter((s) => pane.surfaces[s.id].on);
      const overlays = [...header.lines, ...header.points].filter((l) => pane.overlays[l.id]);
      const title = this.keep(`title ${k}`, () => element('div', { class: 'title' }));
      this.write(title, [...shown, ...overlays].map((l) => l.name).join(', ') || 'nothing is shown');
      title.classList.toggle('active', viewer.panes.length > 1 && k === viewer.active);
      this.style(title, 'maxWidth', `${width - 28}px`);
      this.move(title, k * width + 12, 10);
      if (k) this.move(this.keep('divider', () => element('div', { class: 'divider' })), k * width - 1, 0);
      const fields = shown.filter((s) => pane.surfaces[s.id].color[0] === 'f').map((s) => s.fields[Number(pane.surfaces[s.id].color.slice(1))]);
      fields.push(...overlays.map((l) => l.field).filter(Boolean));
      fields.forEach((field, i) => {
        const node = this.keep(`legend ${k} ${i} ${field.name}`, () => this.legend(field));
        this.style(node, 'right', `${whole - (k + 1) * width + 14}px`);
        this.style(node, 'bottom', `${14 + 74 * i}px`);
        const range = viewer.ranges.get(field);
        const low = field.diverging ? -range : 0;
        node.querySelectorAll('.ticks span').forEach((tick, t) => this.write(tick, short(low + ((range - low) * t) / 4)));
      });
    });
    this.scaleBar(height);
    this.triad(height);
    for (const key of this.unused) {
      this.nodes.get(key).remove();
      this.nodes.delete(key);
    }
  }

  keep(key, make) {
    this.unused.delete(key);
    if (!this.nodes.has(key)) {
      this.nodes.set(key, make());
      this.root.append(this.nodes.get(key));
    }
    return this.nodes.get(key);
  }

  style(node, name, value) {
    if (node.style[name] !== value) node.style[name] = value;
  }

  write(node, text) {
    if (node.textContent !== text) node.textContent = text;
  }

  move(node, x, y) {
    const transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    if (node.placed !== transform) node.style.transform = node.placed = transform;
  }

  legend(field) {
    const { viewer } = this;
    const stops = (field.diverging ? viewer.header.diverging : viewer.header.sequential).map((c) => `rgb(${c})`);
    const bar = element('div', { class: 'bar', style: `background:linear-gradient(90deg, ${stops.join(',')})` });
    const ticks = element('div', { class: 'ticks' }, ...[0, 1, 2, 3, 4].map(() => element('span')));
    const input = element('input', {
      type: 'number', step: 'any', min: '0', value: String(Number(viewer.ranges.get(field).toPrecision(3))), 'aria-label': `Colours of ${field.name} end at, ${field.unit}`,
      onchange: (e) => {
        const value = Number(e.target.value);
        if (value > 0) viewer.ranges.set(field, value);
        viewer.request();
      },
    });
    const most = Math.max(field.high, -field.low);
    const head = element('div', { class: 'head' }, element('strong', {}, `${field.name}, ${field.unit}`));
    const foot = element('label', { class: 'foot' }, 'colours end at ', input, ` of ${figure(most)}`);
    return element('div', { class: 'legend' }, head, bar, ticks, foot);
  }

  scaleBar(height) {
    const perPixel = (2 * this.viewer.camera.halfHeight) / height;
    const rough = 110 * perPixel;
    const power = 10 ** Math.floor(Math.log10(rough));
    const length = [5, 2, 1].map((m) => m * power).find((l) => l <= rough) ?? power;
    const bar = this.keep('scale', () => element('div', { class: 'scale' }, element('span')));
    this.write(bar.firstChild, `${figure(length)} mm`);
    this.style(bar, 'width', `${(length / perPixel).toFixed(1)}px`);
    this.move(bar, 14, height - 26);
  }

  triad(height) {
    const svg = (tag, attributes, ...children) => {
      const node = document.createElementNS('http://www.w3.org/2000/svg', tag);
      for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
      node.append(...children);
      return node;
    };
    const [right, up, back] = this.viewer.camera.axes();
    const picture = this.keep('triad', () => svg('svg', { class: 'triad', width: 76, height: 76, viewBox: '-38 -38 76 76', 'aria-hidden': 'true' }));
    this.move(picture, 8, height - 112);
    const turned = [...right, ...up].map((x) => x.toFixed(3)).join();
    if (picture.turned === turned) return;
    picture.turned = turned;
    const arms = ['x', 'y', 'z'].map((name, k) => ({ name, x: 24 * right[k], y: -24 * up[k], z: back[k], color: ['#b3332e', '#2c7a3f', '#2456a6'][k] }));
    arms.sort((a, b) => a.z - b.z);
    picture.replaceChildren(...arms.flatMap(({ name, x, y, color }) => [
      svg('line', { x1: 0, y1: 0, x2: x, y2: y, stroke: color, 'stroke-width': 2.2, 'stroke-linecap': 'round' }),
      svg('text', { x: x * 1.36, y: y * 1.36 + 4, 'text-anchor': 'middle', 'font-size': 12, fill: color }, name),
    ]));
  }
}
