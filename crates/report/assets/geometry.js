// Meshes as the graphics card takes them.

/**
 * Corners of triangles that share a place, a normal and a group become one vertex. Normals are means over the faces
 * around a vertex that turn by less than the crease angle from the face of the corner.
 */
function splitVertices(points, triangles, creaseDegrees, idOfFace) {
  const faces = triangles.length / 3;
  const count = points.length / 3;
  const normals = new Float32Array(3 * faces);
  const lengths = new Float32Array(faces);
  for (let f = 0; f < faces; f++) {
    const [a, b, c] = [3 * triangles[3 * f], 3 * triangles[3 * f + 1], 3 * triangles[3 * f + 2]];
    const [ux, uy, uz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
    const [vx, vy, vz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.hypot(n[0], n[1], n[2]);
    lengths[f] = length;
    if (length > 0) for (let k = 0; k < 3; k++) normals[3 * f + k] = n[k] / length;
  }
  // The corners around each vertex.
  const first = new Uint32Array(count + 1);
  for (const v of triangles) first[v + 1]++;
  for (let v = 0; v < count; v++) first[v + 1] += first[v];
  const corners = new Uint32Array(triangles.length);
  const next = first.slice();
  for (let c = 0; c < triangles.length; c++) corners[next[triangles[c]]++] = c;

  const cosine = Math.cos((creaseDegrees * Math.PI) / 180);
  const index = new Uint32Array(triangles.length);
  const source = [];
  const normal = [];
  const group = [];
  for (let v = 0; v < count; v++) {
    const start = source.length;
    for (let i = first[v]; i < first[v + 1]; i++) {
      const f = (corners[i] / 3) | 0;
      const id = idOfFace ? idOfFace[f] : 0;
      let [x, y, z] = [0, 0, 0];
      for (let j = first[v]; j < first[v + 1]; j++) {
        const g = (corners[j] / 3) | 0;
        const turn = normals[3 * f] * normals[3 * g] + normals[3 * f + 1] * normals[3 * g + 1] + normals[3 * f + 2] * normals[3 * g + 2];
        if (g === f || turn >= cosine) {
          x += lengths[g] * normals[3 * g];
          y += lengths[g] * normals[3 * g + 1];
          z += lengths[g] * normals[3 * g + 2];
        }
      }
      const length = Math.hypot(x, y, z) || 1;
      [x, y, z] = [x / length, y / length, z / length];
      let found = -1;
      for (let s = start; s < source.length && found < 0; s++) {
        if (group[s] === id && normal[3 * s] * x + normal[3 * s + 1] * y + normal[3 * s + 2] * z > 0.9995) found = s;
      }
      if (found < 0) {
        found = source.length;
        source.push(v);
        group.push(id);
        normal.push(x, y, z);
      }
      index[corners[i]] = found;
    }
  }
  const places = new Float32Array(3 * source.length);
  for (let s = 0; s < source.length; s++) {
    for (let k = 0; k < 3; k++) places[3 * s + k] = points[3 * source[s] + k];
  }
  return {
    index,
    places,
    source: Uint32Array.from(source),
    group: Uint32Array.from(group),
    normals: Int8Array.from(normal, (x) => Math.round(127 * x)),
  };
}

/** Where a line towards the viewer meets a mesh first. Ends and direction in mm; `keep` says which points are there. */
function pick(points, triangles, origin, axes, keep) {
  const [right, up, back] = axes;
  const count = points.length / 3;
  const [x, y, z] = [new Float32Array(count), new Float32Array(count), new Float32Array(count)];
  for (let v = 0; v < count; v++) {
    const d = [points[3 * v] - origin[0], points[3 * v + 1] - origin[1], points[3 * v + 2] - origin[2]];
    x[v] = dot(d, right);
    y[v] = dot(d, up);
    z[v] = dot(d, back);
  }
  let best = null;
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a]);
    if (area <= 0) continue;
    const wb = (x[a] * y[c] - x[c] * y[a]) / -area;
    const wc = (x[b] * y[a] - x[a] * y[b]) / -area;
    const wa = 1 - wb - wc;
    if (wa < 0 || wb < 0 || wc < 0) continue;
    const depth = wa * z[a] + wb * z[b] + wc * z[c];
    if (best && depth <= best.depth) continue;
    const at = [0, 1, 2].map((k) => wa * points[3 * a + k] + wb * points[3 * b + k] + wc * points[3 * c + k]);
    if (keep(at)) best = { depth, at, face: t / 3, vertices: [a, b, c], weights: [wa, wb, wc] };
  }
  return best;
}

/** Whether a mesh is closed, by sums over its edges that cancel where each is run along both ways, and not inside out. */
function isSolid(points, triangles) {
  let [sum, xor, volume] = [0, 0, 0];
  const at = (v, k) => points[3 * v + k];
  for (let t = 0; t < triangles.length; t += 3) {
    const corner = [triangles[t], triangles[t + 1], triangles[t + 2]];
    for (let k = 0; k < 3; k++) {
      const [a, b] = [corner[k], corner[(k + 1) % 3]];
      const hash = Math.imul(Math.imul(Math.min(a, b), 0x9e3779b1) ^ Math.max(a, b), 0x85ebca6b) | 0;
      sum = (sum + (a < b ? hash : -hash)) | 0;
      xor ^= hash;
    }
    const [a, b, c] = corner;
    volume += at(a, 0) * (at(b, 1) * at(c, 2) - at(b, 2) * at(c, 1)) + at(a, 1) * (at(b, 2) * at(c, 0) - at(b, 0) * at(c, 2))
      + at(a, 2) * (at(b, 0) * at(c, 1) - at(b, 1) * at(c, 0));
  }
  return sum === 0 && xor === 0 && volume > 0;
}
