// The viewer: state, input, and when it is drawn.

/** A frame of more milliseconds is slow: with what the page needs beside it there would be fewer than 30 a second. */
const SLOW = 26;
/** After a motion whose frames took fewer, the next one is drawn with more triangles. */
const QUICK = 9;
/** What a processor that draws is given at first, triangles. */
const SOFTWARE_BUDGET = 16000;
/** Pixels of the canvas per pixel of the screen while a slow card turns the model. */
const MOVING_SCALE = 0.5;

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
    /** So many triangles are drawn while the model moves; finite on a slow card, which draws fewer pixels then too. */
    this.budget = Infinity;
    /** The most the budget is raised to: more turned out to be slow. */
    this.ceiling = Infinity;
    /** Times of the frames of this motion, ms. */
    this.frames = [];

    this.canvas = element('canvas', { tabindex: '0', role: 'application', 'aria-roledescription': 'three-dimensional view',
      'aria-label': 'Model. Arrow keys turn it, plus and minus zoom, 1 to 7 choose a view, F fits, S cuts it open.' });
    this.annotations = new Annotations(this);
    this.tip = element('div', { class: 'tip', hidden: true });
    this.status = element('div', { class: 'hidden', role: 'status', 'aria-live': 'polite' });
    this.stage = element('div', { class: 'stage' }, this.canvas, this.annotations.root, this.tip, this.status);
    this.renderer = new Renderer(this.canvas, header, bytes);
    if (this.renderer.isSoftware()) this.budget = SOFTWARE_BUDGET;
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
    canvas.addEventListener('webglcontextlost', (e) => {
      e.preventDefault();
      this.steps = null;
      this.say('The graphics card was taken away; the model is drawn again once it is back.');
    });
    canvas.addEventListener('webglcontextrestored', () => {
      this.renderer = new Renderer(canvas, this.header, this.renderer.bytes);
      this.request();
    });
    new ResizeObserver(() => this.refit()).observe(this.stage);
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
    this.moving();
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

  /** What is to be seen, with `scale` pixels of the canvas per pixel of the screen. */
  view(scale) {
    const { clientWidth, clientHeight } = this.stage;
    const ratio = Math.min(window.devicePixelRatio || 1, 2) * scale;
    return {
      panes: this.panes, camera: this.camera, ranges: this.ranges, plane: this.plane(), ratio,
      width: Math.max(1, Math.round(clientWidth * ratio)), height: Math.max(1, Math.round(clientHeight * ratio)),
    };
  }

  /** The model moves, until nothing has moved it for a while. */
  moving() {
    if (!this.inMotion) this.frames = [];
    this.inMotion = true;
    this.request();
  }

  /** Counted from the last frame, not from the last event: a frame may take longer than that. */
  settle() {
    clearTimeout(this.settling);
    this.settling = setTimeout(() => {
      this.inMotion = false;
      this.moreOfIt();
      this.request();
    }, 250);
  }

  request() {
    document.documentElement.dataset.viewer = 'drawing';
    this.steps = null;
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      if (this.inMotion) this.drawMoving();
      else if (this.budget === Infinity) this.draw();
      else this.drawSlowly();
    });
  }

  /** At once, and well. */
  draw() {
    this.steps = null;
    for (const _ of this.renderer.drawWell(this.view(1))) continue;
    this.atRest();
  }

  atRest() {
    this.annotations.update();
    document.documentElement.dataset.viewer = 'ready';
  }

  drawMoving() {
    // Frames must not pile up.
    if (this.busy) {
      this.late = true;
      return;
    }
    const quick = this.budget < Infinity;
    const view = this.view(quick ? MOVING_SCALE : 1);
    const { renderer } = this;
    const { made } = renderer;
    if (quick) renderer.drawQuickly(view, this.budget);
    else for (const _ of renderer.drawWell(view)) continue;
    this.annotations.update();
    this.busy = true;
    renderer.whenDrawn((time) => {
      this.busy = false;
      // What had to be made first says nothing of the next frame.
      if (renderer.made === made) {
        this.frames.push(time);
        this.lessOfIt(view);
      }
      if (this.late) this.request();
      this.late = false;
      this.settle();
    });
  }

  /** Fewer triangles where two frames in succession were slow: a single one may be the fault of something else. */
  lessOfIt(view) {
    const time = Math.min(...this.frames.slice(-2));
    if (this.frames.length < 2 || time <= SLOW) return;
    const all = this.renderer.triangles(view);
    // Fewer pixels and samples are worth a factor of about four.
    const wanted = this.budget < Infinity ? (Math.min(this.budget, all) * SLOW) / time : (all * 4 * SLOW) / time;
    if (this.raised) this.ceiling = this.raised;
    this.budget = LADDER.findLast((n) => n <= wanted) ?? LADDER[0];
    this.frames = [];
  }

  /** More triangles the next time where all frames were quick. */
  moreOfIt() {
    this.raised = null;
    if (this.frames.length < 4 || this.budget >= this.ceiling || Math.max(...this.frames.slice(-8)) > QUICK) return;
    this.raised = this.budget;
    this.budget = this.budget < this.renderer.triangles(this.view(1)) ? LADDER.find((n) => n > this.budget) ?? Infinity : Infinity;
  }

  /** On a slow card: fast at first, then piece by piece as well as can be, until something else is asked for. */
  drawSlowly() {
    this.renderer.drawQuickly(this.view(MOVING_SCALE), this.budget);
    this.annotations.update();
    const steps = this.renderer.drawWell(this.view(1));
    this.steps = steps;
    const step = () => {
      if (this.steps !== steps) return;
      if (!steps.next().done) this.renderer.whenDrawn(step);
      else {
        this.steps = null;
        this.atRest();
      }
    };
    this.renderer.whenDrawn(step);
  }

  /** Where a point of the world is on the canvas, in pixels of CSS. */
  place(p, pane) {
    const [x, y] = this.camera.project(p);
    const { clientWidth: width, clientHeight: height } = this.stage;
    const w = width / this.panes.length;
    return [pane * w + w / 2 + (x * height) / 2, height / 2 - (y * height) / 2];
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
    const pictures = document.querySelector('.pictures') ? 'the pictures and ' : '';
    host.className = 'empty';
    host.replaceChildren(element('p', { class: 'note', role: 'status' }, `The model cannot be turned here: ${error.message}. `
      + `Another browser, or graphics acceleration switched on in the settings of this one, will show it; ${pictures}all figures below do not need it.`));
    document.documentElement.dataset.viewer = 'failed';
  }
}
start();
