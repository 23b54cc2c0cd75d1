// Drawing: one canvas with one or two panes, which share geometry and camera and show layers of their own.

/** So many triangles of a surface are drawn while a slow card turns the model, and a very slow one. */
const TRIANGLES_IN_A_HURRY = [Infinity, 40000, 10000];
/** Samples of a pixel at rest. */
const SAMPLES = 4;

const STEEL = [0.69, 0.745, 0.8];

class Renderer {
  constructor(canvas, header, bytes) {
    const gl = canvas.getContext('webgl2', { antialias: false, alpha: false, powerPreference: 'low-power' });
    if (!gl) throw new Error('this browser has no WebGL 2');
    this.gl = gl;
    this.canvas = canvas;
    this.header = header;
    this.bytes = bytes;
    this.surfaceProgram = compile(gl, SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.lineProgram = compile(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.thinLineProgram = compile(gl, THIN_LINE_VERTEX, LINE_FRAGMENT);
    this.pointProgram = compile(gl, POINT_VERTEX, POINT_FRAGMENT);
    this.maps = { sequential: this.texture(header.sequential), diverging: this.texture(header.diverging) };
    this.meshes = new Map();
    this.built = new Map();
    this.plane = null;
    /** Draw well (0), fast rather than well (1), or as fast as can be (2). */
    this.hurry = 0;
    /** Whether geometry was made since this was last set to false: that takes longer than a frame. */
    this.prepared = false;
  }

  /** 256 colours between the given ones. */
  texture(stops) {
    const gl = this.gl;
    const data = new Uint8Array(256 * 4);
    const last = Math.max(stops.length - 1, 1);
    for (let k = 0; k < 256; k++) {
      const at = (k / 255) * last;
      const low = Math.min(Math.floor(at), last - 1);
      for (let c = 0; c < 3; c++) {
        const [a, b] = [stops[low]?.[c] ?? 128, stops[low + 1]?.[c] ?? 128];
        data[4 * k + c] = Math.round(a + (b - a) * (at - low));
      }
      data[4 * k + 3] = 255;
    }
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, data);
    for (const [name, value] of [['MIN_FILTER', 'LINEAR'], ['MAG_FILTER', 'LINEAR'], ['WRAP_S', 'CLAMP_TO_EDGE'], ['WRAP_T', 'CLAMP_TO_EDGE']]) {
      gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}`], gl[value]);
    }
    return texture;
  }

  buffer(location, data, size, type, normalized, divisor = 0, stride = 0, offset = 0) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, size, type, normalized, stride, offset);
    gl.vertexAttribDivisor(location, divisor);
  }

  /** Points and triangles of a surface, decoded when they are first needed. */
  mesh(surface) {
    if (!this.meshes.has(surface.id)) {
      this.meshes.set(surface.id, {
        points: readPositions(this.bytes, surface.positions, this.header),
        triangles: readIntegers(this.bytes, surface.triangles),
        ids: surface.categories.map(() => null),
        fields: surface.fields.map(() => null),
      });
    }
    return this.meshes.get(surface.id);
  }

  ids(surface, k) {
    const mesh = this.mesh(surface);
    return (mesh.ids[k] ??= readIntegers(this.bytes, surface.categories[k].ids));
  }

  field(surface, k) {
    const mesh = this.mesh(surface);
    return (mesh.fields[k] ??= readField(this.bytes, surface.fields[k]));
  }

  /** A surface on the graphics card, coloured one way: 'plain', 'c0' ... or 'f0' ... */
  surface(surface, coloring) {
    const key = `${surface.id} ${coloring}`;
    if (this.built.has(key)) return this.built.get(key);
    const gl = this.gl;
    const { points, triangles } = this.mesh(surface);
    const [kind, number] = [coloring[0], Number(coloring.slice(1))];
    const ids = kind === 'c' ? this.ids(surface, number) : null;
    const { index, places, source, group, normals } = splitVertices(points, triangles, surface.crease, ids);
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(0, places, 3, gl.FLOAT, false);
    this.buffer(1, normals, 3, gl.BYTE, true);
    if (kind === 'c') {
      const { colors } = surface.categories[number];
      const data = new Uint8Array(3 * group.length);
      for (let s = 0; s < group.length; s++) data.set(group[s] ? colors[group[s] - 1] ?? [190, 190, 190] : [200, 202, 205], 3 * s);
      this.buffer(2, data, 3, gl.UNSIGNED_BYTE, true);
    }
    if (kind === 'f') {
      const field = this.field(surface, number);
      this.buffer(3, Float32Array.from(source, (v) => field[v]), 1, gl.FLOAT, false);
    }
    const indices = this.indices(index);
    gl.bindVertexArray(null);
    const built = { array, solid: isSolid(points, triangles), levels: [indices] };
    // Made when they are first needed: on most cards they never are.
    built.indices = (level) => (built.levels[level] ??= this.coarse(built, level, [index, places, group]));
    this.built.set(key, built);
    this.prepared = true;
    return built;
  }

  /** Fewer triangles, where there are more than twice as many as wanted. */
  coarse(built, level, [index, places, group]) {
    this.prepared = true;
    const wanted = TRIANGLES_IN_A_HURRY[level];
    if (index.length < 6 * wanted) return built.indices(level - 1);
    return this.indices(coarsened(index, places, group, wanted));
  }

  indices(index) {
    const gl = this.gl;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
    return { buffer, count: index.length };
  }

  lines(lines) {
    if (this.built.has(lines.id)) return this.built.get(lines.id);
    const gl = this.gl;
    const points = readPositions(this.bytes, lines.points, this.header);
    const segments = readIntegers(this.bytes, lines.segments);
    const field = lines.field && readField(this.bytes, lines.field);
    const data = new Float32Array(4 * segments.length);
    for (let s = 0; s < segments.length; s += 2) {
      for (let end = 0; end < 2; end++) {
        const v = segments[s + end];
        for (let k = 0; k < 3; k++) data[4 * s + 3 * end + k] = points[3 * v + k];
        data[4 * s + 6 + end] = field ? field[v] : 0;
      }
    }
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    for (const [location, size, offset] of [[0, 3, 0], [1, 3, 12], [2, 2, 24]]) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, 32, offset);
      gl.vertexAttribDivisor(location, 1);
    }
    const thin = gl.createVertexArray();
    gl.bindVertexArray(thin);
    this.buffer(0, points, 3, gl.FLOAT, false);
    if (field) this.buffer(1, field, 1, gl.FLOAT, false);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, segments, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    const built = { array, thin, count: segments.length / 2 };
    this.built.set(lines.id, built);
    return built;
  }

  dots(points) {
    if (this.built.has(points.id)) return this.built.get(points.id);
    const gl = this.gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(0, readPositions(this.bytes, points.points, this.header), 3, gl.FLOAT, false);
    gl.bindVertexArray(null);
    const built = { array, count: points.points.count };
    this.built.set(points.id, built);
    return built;
  }

  /**
   * Buffers with several samples a pixel, of the size of the canvas, or null if the card has none. A canvas cannot change its samples,
   * and while a slow card turns the model they cost half of its time.
   */
  samples() {
    const gl = this.gl;
    const { width, height } = this.canvas;
    if (this.sampled?.width === width && this.sampled.height === height) return this.sampled.ready ? this.sampled : null;
    this.sampled?.buffers.forEach((buffer) => gl.deleteRenderbuffer(buffer));
    this.sampled?.frames.forEach((frame) => gl.deleteFramebuffer(frame));
    const buffers = [];
    const frame = (samples, attachments) => {
      const made = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, made);
      for (const [attachment, format] of attachments) {
        const buffer = gl.createRenderbuffer();
        gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
        gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, format, width, height);
        gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, buffer);
        buffers.push(buffer);
      }
      return made;
    };
    const color = [gl.COLOR_ATTACHMENT0, gl.RGBA8];
    const many = Math.min(SAMPLES, gl.getParameter(gl.MAX_SAMPLES));
    // Samples are averaged into a buffer of their own format first: that of the canvas differs between browsers.
    const frames = [frame(many, [color, [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24]]), frame(0, [color])];
    const complete = (made) => {
      gl.bindFramebuffer(gl.FRAMEBUFFER, made);
      return gl.checkFramebufferStatus(gl.FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
    };
    this.sampled = { width, height, buffers, frames, ready: frames.every(complete) };
    return this.sampled.ready ? this.sampled : null;
  }

  /** Draws all panes; `ratio` is pixels of the canvas per pixel of CSS. */
  draw(panes, camera, ranges, ratio) {
    const gl = this.gl;
    const { width, height } = this.canvas;
    const sampled = this.hurry ? null : this.samples();
    gl.bindFramebuffer(gl.FRAMEBUFFER, sampled?.frames[0] ?? null);
    this.drawPanes(panes, camera, ranges, ratio);
    if (!sampled) return;
    const copy = (from, to) => {
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
      gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    };
    copy(sampled.frames[0], sampled.frames[1]);
    // A browser empties a canvas that it has shown before the next drawing on it; some do not take a copy for drawing.
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.clear(gl.COLOR_BUFFER_BIT);
    copy(sampled.frames[1], null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  drawPanes(panes, camera, ranges, ratio) {
    const gl = this.gl;
    const { width, height } = this.canvas;
    gl.enable(gl.SCISSOR_TEST);
    panes.forEach((pane, k) => {
      const left = Math.round((k * width) / panes.length);
      const right = Math.round(((k + 1) * width) / panes.length) - (k + 1 < panes.length ? Math.ceil(ratio) : 0);
      gl.viewport(left, 0, right - left, height);
      gl.scissor(left, 0, right - left, height);
      this.pane(pane, camera, ranges, [right - left, height], ratio);
    });
    gl.disable(gl.SCISSOR_TEST);
  }

  use(program, camera, size) {
    const gl = this.gl;
    const u = program.uniforms;
    gl.useProgram(program.program);
    const [x, y, z] = camera.axes();
    gl.uniformMatrix3fv(u.uAxes, false, [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]]);
    gl.uniform3fv(u.uCenter, camera.center);
    const half = camera.halfHeight;
    gl.uniform2f(u.uScale, size[1] / size[0] / half, 1 / half);
    gl.uniform1f(u.uDepth, 1 / (1.3 * camera.diagonal + Math.hypot(...along(camera.center, [0, 1, 2].map((k) => (camera.low[k] + camera.high[k]) / 2), -1))));
    gl.uniform1i(u.uCut, this.plane ? 1 : 0);
    gl.uniform4fv(u.uPlane, this.plane ?? [0, 0, 1, 0]);
    return u;
  }

  bindField(u, field, range) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, field?.diverging ? this.maps.diverging : this.maps.sequential);
    gl.uniform1i(u.uMap, 0);
    gl.uniform2f(u.uRange, field?.diverging ? -range : 0, range);
  }

  pane(pane, camera, ranges, size, ratio) {
    const gl = this.gl;
    gl.clearColor(0.965, 0.97, 0.975, 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const shown = this.header.surfaces.filter((s) => pane.surfaces[s.id].on);
    const surfaces = (wanted) => {
      const u = this.use(this.surfaceProgram, camera, size);
      gl.uniform3fv(u.uColor, STEEL);
      gl.uniform1f(u.uPixel, ratio);
      for (const surface of shown.filter(wanted)) {
        const { color, opacity } = pane.surfaces[surface.id];
        const mode = { p: 0, c: 1, f: 2 }[color[0]];
        const field = mode === 2 ? surface.fields[Number(color.slice(1))] : null;
        this.bindField(u, field, field ? ranges.get(field) : 1);
        gl.uniform1i(u.uMode, mode);
        gl.uniform1f(u.uOpacity, opacity);
        const built = this.surface(surface, color);
        gl.bindVertexArray(built.array);
        const { buffer, count } = built.indices(this.hurry);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
        // The far side of a closed surface is never seen, but at silhouettes a pixel might catch it.
        if ((built.solid && !this.plane) || opacity < 1) gl.enable(gl.CULL_FACE);
        else gl.disable(gl.CULL_FACE);
        gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
      }
    };
    const overlays = (inFront, alpha) => {
      const wide = !this.hurry;
      let u = this.use(wide ? this.lineProgram : this.thinLineProgram, camera, size);
      if (wide) gl.uniform2fv(u.uSize, size);
      gl.uniform1f(u.uLift, inFront ? 0 : 6e-4);
      for (const lines of this.header.lines.filter((l) => pane.overlays[l.id] && l.in_front === inFront)) {
        this.bindField(u, lines.field, lines.field ? ranges.get(lines.field) : 1);
        gl.uniform1i(u.uByField, lines.field ? 1 : 0);
        if (wide) gl.uniform1f(u.uWidth, lines.width * ratio);
        gl.uniform4fv(u.uColor, [...lines.color.map((c) => c / 255), alpha]);
        const { array, thin, count } = this.lines(lines);
        gl.bindVertexArray(wide ? array : thin);
        if (wide) gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
        else gl.drawElements(gl.LINES, 2 * count, gl.UNSIGNED_INT, 0);
      }
      u = this.use(this.pointProgram, camera, size);
      gl.uniform1f(u.uLift, inFront ? 1e-4 : 8e-4);
      for (const points of this.header.points.filter((p) => pane.overlays[p.id] && p.in_front === inFront)) {
        gl.uniform1f(u.uSize, points.size * ratio);
        gl.uniform4fv(u.uColor, [...points.color.map((c) => c / 255), alpha]);
        const { array, count } = this.dots(points);
        gl.bindVertexArray(array);
        gl.drawArrays(gl.POINTS, 0, count);
      }
    };
    const opaque = (s) => pane.surfaces[s.id].opacity >= 1;
    gl.disable(gl.BLEND);
    gl.disable(gl.CULL_FACE);
    surfaces(opaque);
    gl.enable(gl.BLEND);
    overlays(false, 1);
    overlays(true, 1);
    // What shines through.
    gl.depthMask(false);
    surfaces((s) => !opaque(s));
    gl.depthMask(true);
    gl.disable(gl.CULL_FACE);
    // And what lies behind, faintly.
    gl.depthFunc(gl.GREATER);
    gl.depthMask(false);
    overlays(true, 0.32);
    gl.depthMask(true);
    gl.depthFunc(gl.LEQUAL);
    gl.bindVertexArray(null);
  }
}
