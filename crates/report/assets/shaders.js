// The programs of the graphics card.

const PROJECTION = `
uniform mat3 uAxes;       // world to right, up, back
uniform vec3 uCenter;
uniform vec2 uScale;      // 1 over half the width and height, mm
uniform float uDepth;     // 1 over the depth that is seen, mm
vec4 project(vec3 p) {
  vec3 q = uAxes * (p - uCenter);
  return vec4(q.xy * uScale, -q.z * uDepth, 1.0);
}`;

// Two programs of each kind: one that may leave pixels out has to be run before their depth is compared, which costs a card that is
// a processor half of its time.
const CUT = `
#ifdef SECTION
uniform vec4 uPlane;      // unit normal and offset of the section plane; what lies beyond is cut away
bool isCut(vec3 p) { return dot(p, uPlane.xyz) > uPlane.w; }
#endif`;
const LEAVE_OUT = `
#ifdef SECTION
  if (isCut(vPosition)) discard;
#endif`;

const FIELD = `
uniform sampler2D uMap;
uniform vec2 uRange;      // values at the two ends of the colours
vec3 fieldColor(float value) {
  float t = clamp((value - uRange.x) / (uRange.y - uRange.x), 0.0, 1.0);
  return texture(uMap, vec2((0.5 + 255.0 * t) / 256.0, 0.5)).rgb;
}`;

const SURFACE_VERTEX = `#version 300 es
${PROJECTION}
layout(location = 0) in vec3 aPosition;
layout(location = 1) in vec3 aNormal;
layout(location = 2) in vec3 aColor;
layout(location = 3) in float aValue;
out vec3 vPosition;
out vec3 vNormal;
out vec3 vColor;
out float vValue;
void main() {
  gl_Position = project(aPosition);
  vPosition = aPosition;
  vNormal = uAxes * aNormal;
  vColor = aColor;
  vValue = aValue;
}`;

const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
${CUT}
${FIELD}
in vec3 vPosition;
in vec3 vNormal;
in vec3 vColor;
in float vValue;
uniform int uMode;        // 0 one colour, 1 a colour for each group, 2 a field
uniform vec3 uColor;
uniform float uOpacity;
uniform float uWarn;      // 1 where backs are pointed out
uniform float uPixel;     // pixels of the screen per pixel of CSS
out vec4 color;
void main() {
${LEAVE_OUT}
  vec3 base = uMode == 0 ? uColor : uMode == 1 ? vColor : fieldColor(vValue);
  if (!gl_FrontFacing) {
#ifdef SECTION
    // Cut open, the inside is drawn as the cut face of a drawing is: flat and hatched.
    float stripe = step(mod(gl_FragCoord.x + gl_FragCoord.y, 9.0 * uPixel), 1.4 * uPixel);
    color = vec4(mix(vec3(0.93, 0.90, 0.84), vec3(0.62, 0.56, 0.46), stripe), 1.0);
    return;
#endif
    // Seen from behind: inside out, or open. At silhouettes a pixel may just catch the far side; that is no warning.
    base = mix(base, vec3(0.89, 0.24, 0.43), uWarn * 0.8 * smoothstep(0.05, 0.3, abs(normalize(vNormal).z)));
  }
  vec3 n = normalize(gl_FrontFacing ? vNormal : -vNormal);
  // Squares and roots instead of powers: they look the same and cost a quarter where the processor draws.
  vec3 linear = base * base;
  float sky = mix(0.26, 0.46, 0.5 + 0.5 * n.y);
  float key = 0.60 * max(dot(n, normalize(vec3(-0.42, 0.62, 0.66))), 0.0);
  float fill = 0.20 * max(dot(n, normalize(vec3(0.75, 0.05, 0.66))), 0.0);
  float shine = max(dot(n, normalize(vec3(-0.42, 0.62, 1.66))), 0.0);
  float shine8 = shine * shine * shine * shine * shine * shine * shine * shine;
  float gloss = uMode == 2 ? 0.0 : 0.08 * shine8 * shine8 * shine8 * shine8 * shine8;
  vec3 lit = linear * (sky + key + fill) + gloss;
  float grazing = 1.0 - abs(n.z);
  color = vec4(sqrt(lit), uOpacity + (1.0 - uOpacity) * 0.6 * grazing * grazing * grazing);
}`;

const LINE_VERTEX = `#version 300 es
${PROJECTION}
layout(location = 0) in vec3 aFrom;
layout(location = 1) in vec3 aTo;
layout(location = 2) in vec2 aValues;
uniform float uWidth;     // pixels
uniform vec2 uSize;       // of the pane, pixels
uniform float uLift;
out vec3 vPosition;
out float vValue;
void main() {
  float end = float(gl_VertexID / 2);
  float side = float(gl_VertexID % 2) * 2.0 - 1.0;
  vec4 from = project(aFrom);
  vec4 to = project(aTo);
  vec2 way = (to.xy - from.xy) * uSize;
  vec2 direction = length(way) > 1e-6 ? normalize(way) : vec2(1.0, 0.0);
  vec2 across = vec2(-direction.y, direction.x);
  vec4 p = mix(from, to, end);
  // Half a width beyond the ends closes the corners of polylines.
  p.xy += (across * side + direction * (end * 2.0 - 1.0) * 0.7) * uWidth / uSize;
  p.z -= uLift;
  gl_Position = p;
  vPosition = mix(aFrom, aTo, end);
  vValue = mix(aValues.x, aValues.y, end);
}`;

// Lines of one pixel, as the card draws them itself: many times cheaper where it is the processor that draws.
const THIN_LINE_VERTEX = `#version 300 es
${PROJECTION}
layout(location = 0) in vec3 aPosition;
layout(location = 1) in float aValue;
uniform float uLift;
out vec3 vPosition;
out float vValue;
void main() {
  gl_Position = project(aPosition);
  gl_Position.z -= uLift;
  vPosition = aPosition;
  vValue = aValue;
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
${CUT}
${FIELD}
in vec3 vPosition;
in float vValue;
uniform vec4 uColor;
uniform bool uByField;
out vec4 color;
void main() {
${LEAVE_OUT}
  color = vec4(uByField ? fieldColor(vValue) : uColor.rgb, uColor.a);
}`;

const POINT_VERTEX = `#version 300 es
${PROJECTION}
layout(location = 0) in vec3 aPosition;
uniform float uSize;      // pixels
uniform float uLift;
out vec3 vPosition;
void main() {
  gl_Position = project(aPosition);
  gl_Position.z -= uLift;
  gl_PointSize = uSize;
  vPosition = aPosition;
}`;

const POINT_FRAGMENT = `#version 300 es
precision highp float;
${CUT}
in vec3 vPosition;
uniform vec4 uColor;
out vec4 color;
void main() {
  vec2 d = gl_PointCoord * 2.0 - 1.0;
  float r = dot(d, d);
  if (r > 1.0) discard;
${LEAVE_OUT}
  color = vec4(uColor.rgb * (r > 0.62 ? 0.72 : 1.0), uColor.a);
}`;

const PROGRAMS = {
  surface: [SURFACE_VERTEX, SURFACE_FRAGMENT],
  line: [LINE_VERTEX, LINE_FRAGMENT],
  thinLine: [THIN_LINE_VERTEX, LINE_FRAGMENT],
  point: [POINT_VERTEX, POINT_FRAGMENT],
};

/** A program with its uniforms by name; with `section` it leaves out what lies beyond the section plane. */
function compile(gl, [vertex, fragment], section) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const source = section ? text.replace('300 es\n', '300 es\n#define SECTION\n') : text;
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const uniforms = {};
  for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
    const { name } = gl.getActiveUniform(program, k);
    uniforms[name] = gl.getUniformLocation(program, name);
  }
  return { program, uniforms };
}
