// What surrounds the canvas: layers, presets, section plane, views, legends, labels.

const VIEWS = [['Iso', -60, 30], ['Front', -90, 0], ['Right', 0, 0], ['Back', 90, 0], ['Left', 180, 0], ['Top', -90, 90], ['Bottom', -90, -90]];

/** An element with attributes, listeners (on...) and children. */
function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) node.addEventListener(name.slice(2), value);
    else if (name in node && typeof value !== 'string') node[name] = value;
    else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

/** Four digits, without an exponent where none is needed. */
function figure(x) {
  const a = Math.abs(x);
  if (a === 0) return '0';
  if (a >= 1e-3 && a < 1e5) return Number(x.toPrecision(4)).toString();
  return x.toExponential(1);
}

/** Three digits, for the ends of a legend. */
const short = (x) => figure(Number(x.toPrecision(3)));

/** Combinations of layers that are looked at most; each is offered where its layers are there. */
function presets(header) {
  const surface = (id) => header.surfaces.find((s) => s.id === id);
  const field = (id, start) => {
    const at = surface(id)?.fields.findIndex((f) => f.name.startsWith(start)) ?? -1;
    return at < 0 ? null : `f${at}`;
  };
  const overlay = (id) => [...header.lines, ...header.points].some((l) => l.id === id);
  const deviation = field('surface', 'Distance from the smoothed');
  const change = field('smoothed', 'Distance');
  const curvature = field('smoothed', 'Mean curvature');
  const has = (...ids) => ids.every((id) => surface(id) || overlay(id));
  const list = [
    ['CAD surface', has('surface'), [{ surface: 'c0', overlays: ['patch-edges'] }]],
    ['Original', has('original'), [{ original: 'plain' }]],
    ['Smoothed', has('smoothed'), [{ smoothed: surface('smoothed')?.categories.length ? 'c0' : 'plain', labels: true }]],
    ['Before | after', has('original', 'smoothed'), [{ original: 'plain' }, { smoothed: 'plain' }]],
    ['Tiles', has('tiles'), [{ tiles: 'c0' }]],
    ['Quads', has('quads'), [{ quads: 'c0', overlays: ['quad-sides'] }]],
    ['Mesh | CAD', has('smoothed', 'surface'), [{ smoothed: 'plain' }, { surface: 'plain', overlays: ['patch-edges'] }]],
    ['Deviation', deviation, [{ surface: deviation }]],
    ['Change by smoothing', change, [{ smoothed: change }]],
    ['Curvature', curvature, [{ smoothed: curvature }]],
    ['Centre line', has('skeleton'), [{ ghost: true, overlays: ['skeleton', 'skeleton-nodes'] }]],
    ['Beams', has('beams'), [{ beams: 'plain', ghost: true }]],
  ];
  return list.filter(([, there]) => there).map(([name, , panes]) => ({ name, panes }));
}

/** A pane that shows nothing yet. */
function emptyPane(header) {
  const plain = (s) => ({ on: false, opacity: 1, color: s.categories.length ? 'c0' : 'plain' });
  return {
    surfaces: Object.fromEntries(header.surfaces.map((s) => [s.id, plain(s)])),
    overlays: Object.fromEntries([...header.lines, ...header.points].map((l) => [l.id, false])),
    labels: false,
  };
}

/** A pane as a preset says. `ghost` is the smoothed mesh, or the one there is, as glass. */
function presetPane(header, preset) {
  const pane = emptyPane(header);
  for (const surface of header.surfaces) {
    const color = preset[surface.id];
    if (!color) continue;
    const usable = color[0] !== 'c' || surface.categories[Number(color.slice(1))];
    Object.assign(pane.surfaces[surface.id], { on: true, color: usable ? color : 'plain' });
  }
  const glass = preset.ghost && (header.surfaces.find((s) => s.id === 'smoothed') ?? header.surfaces[0]);
  if (glass) Object.assign(pane.surfaces[glass.id], { on: true, opacity: 0.22, color: 'plain' });
  for (const id of preset.overlays ?? []) if (id in pane.overlays) pane.overlays[id] = true;
  pane.labels = Boolean(preset.labels);
  return pane;
}

/** The panel beside the canvas. It edits the active pane of `viewer` and asks it to draw. */
class Controls {
  constructor(viewer) {
    this.viewer = viewer;
    this.root = element('div', { class: 'panel' });
    this.build();
  }

  group(title, ...children) {
    return element('fieldset', {}, element('legend', {}, title), ...children);
  }

  build() {
    const { viewer } = this;
    const { header } = viewer;
    const pane = viewer.panes[viewer.active];
    this.root.replaceChildren();
    const offered = presets(header);
    if (offered.length > 1) {
      const buttons = offered.map(({ name, panes }) =>
        element('button', { type: 'button', class: 'preset', 'aria-pressed': String(viewer.preset === name), onclick: () => viewer.apply(name, panes) }, name),
      );
      this.root.append(this.group('Show', element('div', { class: 'buttons' }, ...buttons)));
    }
    const two = element('input', { type: 'checkbox', checked: viewer.panes.length === 2, onchange: (e) => viewer.split(e.target.checked) });
    const side = element('label', { class: 'check' }, two, 'Side by side, one camera');
    const tabs = ['Left', 'Right'].map((name, k) =>
      element('button', { type: 'button', 'aria-pressed': String(viewer.active === k), onclick: () => viewer.activate(k) }, name),
    );
    const surfaces = header.surfaces.map((surface) => this.surface(surface, pane.surfaces[surface.id]));
    const overlays = [...header.lines, ...header.points].map((layer) =>
      this.check(layer.name, pane.overlays[layer.id], (on) => (pane.overlays[layer.id] = on), `rgb(${layer.color})`, layer.id),
    );
    if (header.labels.length) overlays.push(this.check('Diameters of holes', pane.labels, (on) => (pane.labels = on), null, 'labels'));
    this.root.append(
      this.group('Layers', side, ...(viewer.panes.length === 2 ? [element('div', { class: 'tabs' }, ...tabs)] : []), ...surfaces, ...overlays),
      this.section(),
      this.group('View', element('div', { class: 'buttons' }, ...VIEWS.map(([name, a, e], k) =>
        element('button', { type: 'button', title: `Key ${k + 1}`, onclick: () => viewer.look(a, e) }, name)),
        element('button', { type: 'button', title: 'Key F', onclick: () => viewer.fit() }, 'Fit'))),
      element('p', { class: 'help' }, 'Drag to turn, with Shift or the right button to move, wheel to zoom. Keys: arrows, + and \u2212, 1 to 7, F; S cuts.'),
    );
  }

  check(name, on, set, swatch, id) {
    const box = element('input', { type: 'checkbox', checked: on, 'data-layer': id, onchange: (e) => this.edit(() => set(e.target.checked)) });
    const dot = swatch ? [element('span', { class: 'swatch', style: `background:${swatch}`, 'aria-hidden': 'true' })] : [];
    return element('label', { class: 'check' }, box, ...dot, name);
  }

  surface(surface, state) {
    const row = element('div', { class: 'layer' }, this.check(surface.name, state.on, (on) => (state.on = on), null, surface.id));
    const options = [['plain', 'plain'], ...surface.categories.map((c, k) => [`c${k}`, c.name]), ...surface.fields.map((f, k) => [`f${k}`, f.name])];
    const choices = options.map(([value, name]) => element('option', { value, selected: value === state.color }, name));
    const select = element('select', { 'aria-label': `Colours of ${surface.name}`, onchange: (e) => this.edit(() => Object.assign(state, { color: e.target.value, on: true })) }, ...choices);
    const glass = element('input', { type: 'checkbox', checked: state.opacity < 1, onchange: (e) => this.edit(() => (state.opacity = e.target.checked ? 0.3 : 1)) });
    row.append(element('div', { class: 'options' }, ...(options.length > 1 ? [select] : []), element('label', { class: 'check small' }, glass, 'glass')));
    return row;
  }

  section() {
    const { viewer } = this;
    const axes = [['', 'none'], ['0', 'across x'], ['1', 'across y'], ['2', 'across z'], ['view', 'across the view']];
    const choices = axes.map(([value, name]) => element('option', { value, selected: value === viewer.cut.axis }, name));
    const select = element('select', { 'aria-label': 'Section plane', id: 'cut-axis', onchange: (e) => viewer.cutAcross(e.target.value) }, ...choices);
    const body = [select];
    if (viewer.cut.axis !== '') {
      const [low, high] = viewer.cut.range;
      const text = element('output', {}, `${figure(viewer.cut.at)} mm`);
      const slider = element('input', {
        type: 'range', min: String(low), max: String(high), step: String((high - low) / 500), value: String(viewer.cut.at),
        'aria-label': 'Place of the section plane, mm', id: 'cut-at',
        oninput: (e) => {
          viewer.cut.at = Number(e.target.value);
          text.textContent = `${figure(viewer.cut.at)} mm`;
          viewer.moving();
        },
      });
      const flip = element('input', { type: 'checkbox', checked: viewer.cut.flip, onchange: (e) => { viewer.cut.flip = e.target.checked; viewer.request(); } });
      body.push(slider, text, element('label', { class: 'check small' }, flip, 'other side'));
    }
    return this.group('Section plane', ...body);
  }

  edit(change) {
    change();
    this.viewer.preset = '';
    this.build();
    this.viewer.request();
  }
}
