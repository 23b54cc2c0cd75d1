// The viewer: state, input, and what is written over the canvas.

/** A frame of more milliseconds is slow; after one of fewer, the next motion is tried with less of a hurry. */
const SLOW = 45;
const QUICK = 8;

class Viewer {
  constructor(host, header, bytes) {
    this.header = header;
    this.camera = new Camera(header.low, header.high);
    this.ranges = new Map();
    for (const layer of [...header.surfaces.flatMap((s) => s.fields), ...header.lines.map((l) => l.field).filter(Boolean)]) {
      this.ranges.set(layer, layer.limit > 0 ? layer.limit : Math.max(layer.high, -layer.low, 1e-9));
    }
    this.cut = { axis: '', at: 0, flip: false, range: [0, 1], normal: [0, 0, 1] };
    this.panes = [emptyPane(header)];
    this.active = 0;
    this.preset = '';
    this.marker = null;
    this.ratio = 1;
    /** How much of a hurry turning the model was the last time. */
    this.slow = 0;
    this.lastFrame = 0;

    this.canvas = element('canvas', { tabindex: '0', role: 'application', 'aria-roledescription': 'three-dimensional view',
      'aria-label': 'Model. Arrow keys turn it, plus and minus zoom, 1 to 7 choose a view, F fits, S cuts it open.' });
    this.overlay = element('div', { class: 'overlay' });
    this.tip = element('div', { class: 'tip', hidden: true });
    this.status = element('div', { class: 'hidden', role: 'status', 'aria-live': 'polite' });
    this.stage = element('div', { class: 'stage' }, this.canvas, this.overlay, this.tip, this.status);
    this.renderer = new Renderer(this.canvas, header, bytes);
    this.controls = new Controls(this);
    host.replaceChildren(this.controls.root, this.stage);
    this.listen();
    const first = presets(header)[0];
    if (first) this.apply(first.name, first.panes);
    else {
      for (const s of header.surfaces.slice(0, 1)) this.panes[0].surfaces[s.id].on = true;
      for (const id of Object.keys(this.panes[0].overlays)) this.panes[0].overlays[id] = true;
      this.controls.build();
    }
    this.resize();
    this.fit();
  }

  // What can be asked of it.

  apply(name, panes) {
    const focused = document.activeElement?.textContent;
    this.preset = name;
    this.panes = panes.map((preset) => presetPane(this.header, preset));
    this.active = 0;
    this.refit();
    this.controls.build();
    for (const button of this.controls.root.querySelectorAll('button.preset')) if (button.textContent === focused) button.focus();
    this.say(name);
  }

  split(two) {
    if (two) this.panes = [this.panes[0], this.panes[1] ?? structuredClone(this.panes[0])];
    else this.panes = [this.panes[this.active]];
    this.active = two ? 1 : 0;
    this.preset = '';
    this.refit();
    this.controls.build();
  }

  activate(k) {
    this.active = k;
    this.controls.build();
    this.request();
  }

  look(azimuth, elevation) {
    Object.assign(this.camera, { azimuth, elevation });
    this.fit();
  }

  aspect() {
    return this.canvas.clientWidth / this.panes.length / Math.max(this.canvas.clientHeight, 1);
  }

  fit() {
    this.marker = null;
    this.camera.fit(this.aspect());
    this.fitted = true;
    this.request();
  }

  /** Fits again if the last thing done was to fit. */
  refit() {
    if (this.fitted) this.camera.fit(this.aspect());
    this.request();
  }

  cutAcross(axis) {
    const { low, high } = this.header;
    this.cut.axis = axis;
    if (axis !== '') {
      const view = axis === 'view';
      this.cut.normal = view ? this.camera.axes()[2] : [0, 1, 2].map((k) => (k === Number(axis) ? 1 : 0));
      const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((c) => dot([0, 1, 2].map((k) => ((c >> k) & 1 ? high : low)[k]), this.cut.normal));
      this.cut.range = [Math.min(...corners), Math.max(...corners)];
      this.cut.at = (this.cut.range[0] + this.cut.range[1]) / 2;
      // The half towards the viewer goes away.
      this.cut.flip = dot(this.cut.normal, this.camera.axes()[2]) < 0;
    }
    this.controls.build();
    this.controls.root.querySelector(axis === '' ? '#cut-axis' : '#cut-at')?.focus({ preventScroll: true });
    this.request();
    this.say(axis === '' ? 'whole' : 'cut open');
  }

  /** Goes to a place and marks it. */
  show(at) {
    this.marker = at;
    this.fitted = false;
    this.camera.center = at.slice();
    this.camera.halfHeight = this.camera.diagonal * 0.12;
    document.getElementById('model').scrollIntoView({ block: 'start' });
    this.say(`place ${at.map((x) => x.toFixed(2)).join(', ')} mm`);
    this.request();
  }

  say(text) {
    this.status.textContent = text;
  }

  // Input.

  listen() {
    const { canvas, camera } = this;
    const held = new Map();
    let spread = 0;
    const position = (e) => {
      const box = canvas.getBoundingClientRect();
      const width = box.width / this.panes.length;
      const pane = Math.min(this.panes.length - 1, Math.max(0, Math.floor((e.clientX - box.left) / width)));
      const x = (2 * (e.clientX - box.left - pane * width) - width) / box.height;
      return { pane, x, y: 1 - (2 * (e.clientY - box.top)) / box.height, px: e.clientX - box.left, py: e.clientY - box.top };
    };
    canvas.addEventListener('pointerdown', (e) => {
      canvas.setPointerCapture(e.pointerId);
      held.set(e.pointerId, e);
      spread = 0;
      this.tip.hidden = true;
      const { pane } = position(e);
      if (pane !== this.active) this.activate(pane);
    });
    canvas.addEventListener('pointermove', (e) => {
      const before = held.get(e.pointerId);
      if (!before) return this.hover(position(e));
      held.set(e.pointerId, e);
      const height = canvas.clientHeight;
      const [dx, dy] = [e.clientX - before.clientX, e.clientY - before.clientY];
      this.fitted = false;
      if (held.size === 2) {
        const [a, b] = [...held.values()];
        const now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
        if (spread) camera.zoom(now / spread);
        spread = now;
        camera.pan(dx / height / 2, -dy / height / 2);
      } else if (e.shiftKey || before.buttons & 6) {
        camera.pan(dx / height, -dy / height);
      } else {
        camera.turn((dx / height) * 220, (dy / height) * 220);
      }
      this.moving();
    });
    for (const kind of ['pointerup', 'pointercancel']) canvas.addEventListener(kind, (e) => held.delete(e.pointerId));
    canvas.addEventListener('pointerleave', () => { this.hovered = null; this.tip.hidden = true; });
    canvas.addEventListener('contextmenu', (e) => e.preventDefault());
    canvas.addEventListener('wheel', (e) => {
      e.preventDefault();
      const { x, y } = position(e);
      this.fitted = false;
      camera.zoom(Math.exp(-e.deltaY * (e.deltaMode ? 0.05 : 0.0015)), x, y);
      this.moving();
    }, { passive: false });
    canvas.addEventListener('keydown', (e) => this.key(e));
    new ResizeObserver(() => this.resize()).observe(this.stage);
    document.addEventListener('click', (e) => {
      const button = e.target.closest('button.place');
      if (button) this.show(button.dataset.at.split(',').map(Number));
    });
  }

  key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const { camera } = this;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const view = VIEWS[Number(e.key) - 1];
    if (arrows[e.key]) {
      const [x, y] = arrows[e.key];
      if (e.shiftKey) camera.pan(0.04 * x, 0.04 * y);
      else camera.turn(-6 * x, 6 * y);
      this.fitted = false;
    } else if (e.key === '+' || e.key === '=') camera.zoom(1.15);
    else if (e.key === '-') camera.zoom(1 / 1.15);
    else if (e.key === 'f' || e.key === 'F') this.fit();
    else if (e.key === 's' || e.key === 'S') {
      this.cutAcross(this.cut.axis === '' ? 'view' : '');
      this.canvas.focus();
    } else if (view) this.look(view[1], view[2]);
    else return;
    e.preventDefault();
    this.request();
  }

  /** What is under the pointer once it rests. */
  hover(position) {
    this.tip.hidden = true;
    this.hovered = position;
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      if (this.hovered === position) this.tell(position);
    }, 120);
  }

  tell({ pane, x, y, px, py }) {
    const [right, up] = this.camera.axes();
    const h = this.camera.halfHeight;
    const origin = along(along(this.camera.center, right, x * h), up, y * h);
    const plane = this.plane();
    const keep = (p) => !plane || dot(p, plane) <= plane[3];
    let best = null;
    for (const surface of this.header.surfaces) {
      const state = this.panes[pane].surfaces[surface.id];
      if (!state.on || state.opacity < 1) continue;
      const mesh = this.renderer.mesh(surface);
      const hit = pick(mesh.points, mesh.triangles, origin, this.camera.axes(), keep);
      if (hit && (!best || hit.depth > best.hit.depth)) best = { hit, surface, state };
    }
    if (!best) return;
    const { hit, surface, state } = best;
    const lines = [surface.name];
    const number = Number(state.color.slice(1));
    if (state.color[0] === 'f') {
      const values = this.renderer.field(surface, number);
      const value = hit.vertices.reduce((sum, v, k) => sum + hit.weights[k] * values[v], 0);
      lines.push(`${surface.fields[number].name}: ${figure(value)} ${surface.fields[number].unit}`);
    } else if (state.color[0] === 'c') {
      const id = this.renderer.ids(surface, number)[hit.face];
      const { names, one } = surface.categories[number];
      if (id) lines.push(names[id - 1] ?? `${one} ${id - 1}`);
    }
    lines.push(`(${hit.at.map((c) => c.toFixed(2)).join(', ')}) mm`);
    this.tip.replaceChildren(...lines.map((line, k) => element(k ? 'div' : 'strong', {}, line)));
    this.tip.hidden = false;
    const left = px + 14 + this.tip.offsetWidth > this.stage.clientWidth ? px - 14 - this.tip.offsetWidth : px + 14;
    this.tip.style.transform = `translate(${Math.max(0, left)}px, ${py + 14}px)`;
  }

  // Output.

  plane() {
    if (this.cut.axis === '') return null;
    const sign = this.cut.flip ? -1 : 1;
    return [...this.cut.normal.map((n) => sign * n), sign * this.cut.at];
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    const ratio = Math.min(window.devicePixelRatio || 1, 2) * this.ratio;
    const size = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) {
      [this.canvas.width, this.canvas.height] = size;
      this.refit();
    }
  }

  /** The model moves, until nothing has moved it for a while. */
  moving() {
    if (!this.inMotion) this.hurry(this.slow);
    this.inMotion = true;
    this.request();
  }

  /** Counted from the last frame, not from the last event: a frame may take longer than that. */
  settle() {
    clearTimeout(this.settling);
    this.settling = setTimeout(() => {
      this.inMotion = false;
      if (this.lastFrame < QUICK) this.slow = Math.max(this.slow - 1, 0);
      this.hurry(0);
      this.request();
    }, 250);
  }

  /** A slow card draws fewer pixels, fewer triangles and thin lines while the model moves. */
  hurry(level) {
    if (this.renderer.hurry === level) return;
    this.renderer.hurry = level;
    this.ratio = level ? 0.5 : 1;
    this.resize();
  }

  request() {
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      this.draw();
    });
  }

  draw() {
    this.renderer.plane = this.plane();
    const ratio = this.canvas.width / Math.max(this.canvas.clientWidth, 1);
    const begun = performance.now();
    this.renderer.draw(this.panes, this.camera, this.ranges, ratio);
    if (this.inMotion) {
      // Reading a pixel waits for the card: only so its time is known, and frames do not pile up.
      const { gl } = this.renderer;
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
      this.lastFrame = performance.now() - begun;
      if (this.lastFrame > SLOW && !this.renderer.prepared) this.hurry((this.slow = Math.min(this.renderer.hurry + 1, 2)));
      this.settle();
    }
    this.renderer.prepared = false;
    this.annotate();
    document.documentElement.dataset.viewer = 'ready';
  }

  /** Where a point of the world is on the canvas, in pixels of CSS. */
  place(p, pane) {
    const [x, y] = this.camera.project(p);
    const { clientWidth: width, clientHeight: height } = this.stage;
    const w = width / this.panes.length;
    return [pane * w + w / 2 + (x * height) / 2, height / 2 - (y * height) / 2];
  }

  annotate() {
    const nodes = [];
    const width = this.stage.clientWidth / this.panes.length;
    const at = (node, x, y) => {
      node.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      nodes.push(node);
    };
    this.panes.forEach((pane, k) => {
      const inside = ([x, y]) => x > k * width && x < (k + 1) * width && y > 0 && y < this.stage.clientHeight;
      const plane = this.plane();
      if (pane.labels) {
        for (const label of this.header.labels) {
          const place = this.place(label.at, k);
          if (inside(place) && (!plane || dot(label.at, plane) <= plane[3])) at(element('span', { class: 'label' }, label.text), ...place);
        }
      }
      if (this.marker) {
        const place = this.place(this.marker, k);
        if (inside(place)) at(element('span', { class: 'marker' }), ...place);
      }
      const shown = this.header.surfaces.filter((s) => pane.surfaces[s.id].on);
      const overlays = [...this.header.lines, ...this.header.points].filter((l) => pane.overlays[l.id]);
      const names = [...shown, ...overlays].map((l) => l.name).join(', ') || 'nothing is shown';
      const title = element('div', { class: `title${this.panes.length > 1 && k === this.active ? ' active' : ''}` }, names);
      title.style.maxWidth = `${width - 28}px`;
      at(title, k * width + 12, 10);
      if (k) at(element('div', { class: 'divider' }), k * width - 1, 0);
      this.legends(pane, shown, k * width + 12, width);
    });
    this.scaleBar(at);
    this.triad(at);
    this.overlay.replaceChildren(...nodes, ...this.legendNodes());
  }

  legends(pane, shown, left, width) {
    const fields = shown.filter((s) => pane.surfaces[s.id].color[0] === 'f').map((s) => s.fields[Number(pane.surfaces[s.id].color.slice(1))]);
    fields.push(...this.header.lines.filter((l) => l.field && pane.overlays[l.id]).map((l) => l.field));
    this.wanted ??= [];
    fields.forEach((field, k) => this.wanted.push({ field, right: left - 12 + width - 14, bottom: 14 + 74 * k }));
  }

  /** Legends are kept while they are the same, so that a value can be typed into them. */
  legendNodes() {
    const wanted = this.wanted ?? [];
    this.wanted = [];
    this.legendsBy ??= new Map();
    const kept = new Map();
    const nodes = wanted.map(({ field, right, bottom }, k) => {
      const key = `${field.name} ${k}`;
      const node = this.legendsBy.get(key)?.field === field ? this.legendsBy.get(key).node : this.legend(field);
      kept.set(key, { field, node });
      node.style.right = `${this.stage.clientWidth - right}px`;
      node.style.bottom = `${bottom}px`;
      const range = this.ranges.get(field);
      const low = field.diverging ? -range : 0;
      node.querySelectorAll('.ticks span').forEach((tick, i) => { tick.textContent = short(low + ((range - low) * i) / 4); });
      return node;
    });
    this.legendsBy = kept;
    return nodes;
  }

  legend(field) {
    const stops = (field.diverging ? this.header.diverging : this.header.sequential).map((c) => `rgb(${c})`);
    const bar = element('div', { class: 'bar', style: `background:linear-gradient(90deg, ${stops.join(',')})` });
    const ticks = element('div', { class: 'ticks' }, ...[0, 1, 2, 3, 4].map(() => element('span')));
    const input = element('input', {
      type: 'number', step: 'any', min: '0', value: String(Number(this.ranges.get(field).toPrecision(3))), 'aria-label': `Colours of ${field.name} end at, ${field.unit}`,
      onchange: (e) => {
        const value = Number(e.target.value);
        if (value > 0) this.ranges.set(field, value);
        this.request();
      },
    });
    const most = Math.max(field.high, -field.low);
    const head = element('div', { class: 'head' }, element('strong', {}, `${field.name}, ${field.unit}`));
    const foot = element('label', { class: 'foot' }, 'colours end at ', input, ` of ${figure(most)}`);
    return element('div', { class: 'legend' }, head, bar, ticks, foot);
  }

  scaleBar(at) {
    const perPixel = (2 * this.camera.halfHeight) / this.stage.clientHeight;
    const rough = 110 * perPixel;
    const power = 10 ** Math.floor(Math.log10(rough));
    const length = [5, 2, 1].map((m) => m * power).find((l) => l <= rough) ?? power;
    const bar = element('div', { class: 'scale' }, element('span', {}, `${figure(length)} mm`));
    bar.style.width = `${length / perPixel}px`;
    at(bar, 14, this.stage.clientHeight - 26);
  }

  triad(at) {
    const svg = (tag, attributes, ...children) => {
      const node = document.createElementNS('http://www.w3.org/2000/svg', tag);
      for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
      node.append(...children);
      return node;
    };
    const [right, up, back] = this.camera.axes();
    const arms = ['x', 'y', 'z'].map((name, k) => ({ name, x: 24 * right[k], y: -24 * up[k], z: back[k], color: ['#b3332e', '#2c7a3f', '#2456a6'][k] }));
    arms.sort((a, b) => a.z - b.z);
    const picture = svg('svg', { class: 'triad', width: 76, height: 76, viewBox: '-38 -38 76 76', 'aria-hidden': 'true' });
    for (const { name, x, y, color } of arms) {
      picture.append(svg('line', { x1: 0, y1: 0, x2: x, y2: y, stroke: color, 'stroke-width': 2.2, 'stroke-linecap': 'round' }),
        svg('text', { x: x * 1.36, y: y * 1.36 + 4, 'text-anchor': 'middle', 'font-size': 12, fill: color }, name));
    }
    at(picture, 8, this.stage.clientHeight - 112);
  }
}

async function start() {
  const host = document.getElementById('viewer');
  if (!host) return;
  try {
    const header = JSON.parse(document.getElementById('scene').textContent);
    const bytes = await unpack(document.getElementById('geometry').textContent, header.bytes);
    window.topipe = new Viewer(host, header, bytes);
  } catch (error) {
    host.replaceChildren(element('p', { class: 'note' }, `The model cannot be shown: ${error.message}. The figures below are complete.`));
    document.documentElement.dataset.viewer = 'failed';
  }
}
start();
