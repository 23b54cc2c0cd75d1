// Drawing: one canvas with one or two panes, which share geometry and camera and show layers of their own.

/** Samples of a pixel at rest. */
const SAMPLES = 4;
/** So many triangles are drawn at once where a drawing may be broken off. */
const PIECE = 20000;
/** More lines than these are one pixel wide. */
const MOST_WIDE_LINES = 100000;
/** About so many lines of a layer are drawn while a slow card turns the model. */
const LINES_WHILE_MOVING = 3000;

const STEEL = [0.69, 0.745, 0.8];

class Renderer {
  constructor(canvas, header, bytes) {
    const gl = canvas.getContext('webgl2', { antialias: false, alpha: false, powerPreference: 'low-power' });
    if (!gl) {
      throw new Error(window.WebGL2RenderingContext
        ? 'this browser gives no WebGL 2 (it is switched off, or the graphics driver is not trusted)'
        : 'this browser has no WebGL 2');
    }
    this.gl = gl;
    this.canvas = canvas;
    this.header = header;
    this.bytes = bytes;
    this.programs = new Map();
    this.maps = { sequential: this.texture(header.sequential), diverging: this.texture(header.diverging) };
    this.meshes = new Map();
    this.built = new Map();
    /** How often something was put on the card. */
    this.made = 0;
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

  /** A surface on the graphics card, coloured one way: 'plain', 'c0' ... or 'f0' ... , with at most about so many triangles. */
  surface(surface, coloring, most) {
    const key = `${surface.id} ${coloring}`;
    if (!this.built.has(key)) {
      const { points, triangles } = this.mesh(surface);
      const [kind, number] = [coloring[0], Number(coloring.slice(1))];
      const split = splitVertices(points, triangles, surface.crease, kind === 'c' ? this.ids(surface, number) : null);
      const field = kind === 'f' ? this.field(surface, number) : null;
      const values = field && Float32Array.from(split.source, (v) => field[v]);
      const colors = kind === 'c' ? surface.categories[number].colors : null;
      this.built.set(key, { solid: isSolid(points, triangles), split, values, colors, fewer: new Map() });
    }
    const built = this.built.get(key);
    const { split, values, colors, fewer, solid } = built;
    const step = LADDER.findLast((n) => n <= most) ?? LADDER[0];
    if (most < split.index.length / 3 && 2 * step < split.index.length / 3) {
      if (!fewer.has(step)) {
        const coarse = coarsened(split, values, step);
        fewer.set(step, { solid, ...this.upload(coarse.split, coarse.values, colors) });
      }
      return fewer.get(step);
    }
    built.all ??= { solid, ...this.upload(split, values, colors) };
    return built.all;
  }

  upload({ index, places, normals, group }, values, colors) {
    const gl = this.gl;
    this.made++;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(0, places, 3, gl.FLOAT, false);
    this.buffer(1, normals, 3, gl.BYTE, true);
    if (colors) {
      const data = new Uint8Array(3 * group.length);
      for (let s = 0; s < group.length; s++) data.set(group[s] ? colors[group[s] - 1] ?? [190, 190, 190] : [200, 202, 205], 3 * s);
      this.buffer(2, data, 3, gl.UNSIGNED_BYTE, true);
    }
    if (values) this.buffer(3, values, 1, gl.FLOAT, false);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { array, count: index.length };
  }

  lines(lines) {
    if (this.built.has(lines.id)) return this.built.get(lines.id);
    const gl = this.gl;
    const points = readPositions(this.bytes, lines.points, this.header);
    const segments = readIntegers(this.bytes, lines.segments);
    const field = lines.field && readField(this.bytes, lines.field);
    const count = segments.length / 2;
    // A dense net is a veil of fine lines.
    const wide = count <= MOST_WIDE_LINES ? this.wideLines(points, segments, field) : null;
    this.made++;
    const thin = gl.createVertexArray();
    gl.bindVertexArray(thin);
    this.buffer(0, points, 3, gl.FLOAT, false);
    if (field) this.buffer(1, field, 1, gl.FLOAT, false);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    // After the segments those that are drawn while the model moves.
    const some = fewerLines(segments, points.length / 3, LINES_WHILE_MOVING);
    const both = new Uint32Array(segments.length + some.length);
    both.set(segments);
    both.set(some, segments.length);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, both, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    const built = { wide, thin, count, some: some.length / 2 };
    this.built.set(lines.id, built);
    return built;
  }

  /** Lines of more than a pixel: a rectangle for each. */
  wideLines(points, segments, field) {
    const gl = this.gl;
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
    gl.bindVertexArray(null);
    return array;
  }

  dots(points) {
    if (this.built.has(points.id)) return this.built.get(points.id);
    const gl = this.gl;
    this.made++;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(0, readPositions(this.bytes, points.points, this.header), 3, gl.FLOAT, false);
    gl.bindVertexArray(null);
    const built = { array, count: points.points.count };
    this.built.set(points.id, built);
    return built;
  }

  /**
   * Buffers with several samples a pixel, or null if the card has none. A canvas cannot change its samples, and while a slow card
   * turns the model they cost half of its time.
   */
  samples(width, height) {
    const gl = this.gl;
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

  resize({ width, height }) {
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
  }

  /** Draws `view` while it moves: one sample a pixel, thin lines, about so many triangles at most. */
  drawQuickly(view, most) {
    this.resize(view);
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, null);
    for (const _ of this.drawPanes(view, most)) continue;
  }

  /**
   * Draws `view` as well as can be. Pauses between pieces, so that it can be broken off; the canvas shows what it did until the end.
   * A view is what is to be seen: panes, camera, ranges of colours, section plane, width and height in pixels, and pixels of the
   * screen per pixel of CSS.
   */
  *drawWell(view) {
    const gl = this.gl;
    const { width, height } = view;
    const sampled = this.samples(width, height);
    if (!sampled) {
      this.resize(view);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      for (const _ of this.drawPanes(view, Infinity)) continue;
      return;
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, sampled.frames[0]);
    yield* this.drawPanes(view, Infinity);
    const copy = (from, to) => {
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
      gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    };
    copy(sampled.frames[0], sampled.frames[1]);
    this.resize(view);
    // A browser empties a canvas that it has shown before the next drawing on it; some do not take a copy for drawing.
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.clear(gl.COLOR_BUFFER_BIT);
    copy(sampled.frames[1], null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** Whether the card says that it is a program on the processor. */
  isSoftware() {
    const { gl } = this;
    // Firefox tells it without the extension, and complains about that.
    let name = String(gl.getParameter(gl.RENDERER));
    if (/webkit/i.test(name)) {
      const info = gl.getExtension('WEBGL_debug_renderer_info');
      if (info) name = String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL));
    }
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
  }

  /** Triangles that a view shows, all of them. */
  triangles({ panes }) {
    const shown = panes.flatMap((pane) => this.header.surfaces.filter((s) => pane.surfaces[s.id].on));
    return shown.reduce((sum, s) => sum + s.triangles.count / 3, 0);
  }

  /** Calls `done` with the milliseconds from now until the card has drawn what it was asked for. */
  whenDrawn(done) {
    const { gl } = this;
    const begun = performance.now();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const look = () => {
      if (!gl.isContextLost() && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) return setTimeout(look, 2);
      gl.deleteSync(fence);
      return done(performance.now() - begun);
    };
    setTimeout(look, 0);
  }

  *drawPanes(view, most) {
    const gl = this.gl;
    const { panes, width, height, ratio } = view;
    for (let k = 0; k < panes.length; k++) {
      const left = Math.round((k * width) / panes.length);
      const right = Math.round(((k + 1) * width) / panes.length) - (k + 1 < panes.length ? Math.ceil(ratio) : 0);
      gl.viewport(left, 0, right - left, height);
      gl.scissor(left, 0, right - left, height);
      gl.enable(gl.SCISSOR_TEST);
      yield* this.pane(panes[k], view, [right - left, height], most);
      gl.disable(gl.SCISSOR_TEST);
    }
  }

  use(name, { camera, plane }, size) {
    const gl = this.gl;
    const key = plane ? `${name} cut` : name;
    if (!this.programs.has(key)) this.programs.set(key, compile(gl, PROGRAMS[name], Boolean(plane)));
    const program = this.programs.get(key);
    const u = program.uniforms;
    gl.useProgram(program.program);
    const [x, y, z] = camera.axes();
    gl.uniformMatrix3fv(u.uAxes, false, [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]]);
    gl.uniform3fv(u.uCenter, camera.center);
    const half = camera.halfHeight;
    gl.uniform2f(u.uScale, size[1] / size[0] / half, 1 / half);
    gl.uniform1f(u.uDepth, 1 / (1.3 * camera.diagonal + Math.hypot(...along(camera.center, [0, 1, 2].map((k) => (camera.low[k] + camera.high[k]) / 2), -1))));
    if (plane) gl.uniform4fv(u.uPlane, plane);
    return u;
  }

  bindField(u, field, range) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, field?.diverging ? this.maps.diverging : this.maps.sequential);
    gl.uniform1i(u.uMap, 0);
    gl.uniform2f(u.uRange, field?.diverging ? -range : 0, range);
  }

  *pane(pane, view, size, most) {
    const gl = this.gl;
    const { ranges, ratio, plane } = view;
    const quick = most < Infinity;
    gl.clearColor(0.965, 0.97, 0.975, 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const shown = this.header.surfaces.filter((s) => pane.surfaces[s.id].on);
    const all = this.triangles(view);
    const surfaces = function* (wanted) {
      const some = shown.filter(wanted);
      if (!some.length) return;
      const u = this.use('surface', view, size);
      gl.uniform3fv(u.uColor, STEEL);
      // Where there are fewer triangles, some turn their backs.
      if (u.uWarn) gl.uniform1f(u.uWarn, quick ? 0 : 1);
      if (u.uPixel) gl.uniform1f(u.uPixel, ratio);
      for (const surface of some) {
        const { color, opacity } = pane.surfaces[surface.id];
        const mode = { p: 0, c: 1, f: 2 }[color[0]];
        const field = mode === 2 ? surface.fields[Number(color.slice(1))] : null;
        this.bindField(u, field, field ? ranges.get(field) : 1);
        gl.uniform1i(u.uMode, mode);
        gl.uniform1f(u.uOpacity, opacity);
        const built = this.surface(surface, color, quick ? (most * surface.triangles.count) / 3 / all : Infinity);
        gl.bindVertexArray(built.array);
        // The far side of a closed surface is never seen, but at silhouettes a pixel might catch it.
        if ((built.solid && !plane) || opacity < 1) gl.enable(gl.CULL_FACE);
        else gl.disable(gl.CULL_FACE);
        for (let at = 0; at < built.count; at += 3 * PIECE) {
          gl.drawElements(gl.TRIANGLES, Math.min(3 * PIECE, built.count - at), gl.UNSIGNED_INT, 4 * at);
          if (!quick) yield;
        }
      }
    }.bind(this);
    const overlays = function* (inFront, alpha) {
      const lines = this.header.lines.filter((l) => pane.overlays[l.id] && l.in_front === inFront);
      for (const layer of lines) {
        const { wide, thin, count, some } = this.lines(layer);
        const fine = quick || !wide;
        const u = this.use(fine ? 'thinLine' : 'line', view, size);
        gl.uniform1f(u.uLift, inFront ? 0 : 6e-4);
        this.bindField(u, layer.field, layer.field ? ranges.get(layer.field) : 1);
        gl.uniform1i(u.uByField, layer.field ? 1 : 0);
        gl.uniform4fv(u.uColor, [...layer.color.map((c) => c / 255), alpha]);
        gl.bindVertexArray(fine ? thin : wide);
        if (quick) {
          gl.drawElements(gl.LINES, 2 * some, gl.UNSIGNED_INT, 8 * count);
        } else if (wide) {
          gl.uniform2fv(u.uSize, size);
          gl.uniform1f(u.uWidth, layer.width * ratio);
          gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
          yield;
        } else {
          for (let at = 0; at < count; at += PIECE) {
            gl.drawElements(gl.LINES, 2 * Math.min(PIECE, count - at), gl.UNSIGNED_INT, 8 * at);
            yield;
          }
        }
      }
      const points = this.header.points.filter((p) => pane.overlays[p.id] && p.in_front === inFront);
      if (!points.length) return;
      const u = this.use('point', view, size);
      gl.uniform1f(u.uLift, inFront ? 1e-4 : 8e-4);
      for (const layer of points) {
        gl.uniform1f(u.uSize, layer.size * ratio);
        gl.uniform4fv(u.uColor, [...layer.color.map((c) => c / 255), alpha]);
        const { array, count } = this.dots(layer);
        gl.bindVertexArray(array);
        gl.drawArrays(gl.POINTS, 0, count);
      }
    }.bind(this);
    const opaque = (s) => pane.surfaces[s.id].opacity >= 1;
    gl.disable(gl.BLEND);
    gl.disable(gl.CULL_FACE);
    yield* surfaces(opaque);
    gl.enable(gl.BLEND);
    yield* overlays(false, 1);
    yield* overlays(true, 1);
    // What shines through.
    gl.depthMask(false);
    yield* surfaces((s) => !opaque(s));
    gl.depthMask(true);
    gl.disable(gl.CULL_FACE);
    // And what lies behind, faintly.
    gl.depthFunc(gl.GREATER);
    gl.depthMask(false);
    yield* overlays(true, 0.32);
    gl.depthMask(true);
    gl.depthFunc(gl.LEQUAL);
    gl.bindVertexArray(null);
  }
}
