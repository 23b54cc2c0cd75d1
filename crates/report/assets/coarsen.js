// A surface with fewer triangles, for what is seen while it moves.

/** The numbers of triangles that a surface may be drawn with: each is made once. */
const LADDER = [8000, 16000, 32000, 64000, 128000];

/**
 * `split` (see splitVertices) with about `wanted` triangles. All vertices in a cell of a grid become one point: the one nearest to
 * the planes of the triangles around it (Lindstrom 2000), so that edges and corners stay. It has a normal for each side it is
 * seen from, and a colour for each group. `values` are those of a field, or null.
 */
function coarsened(split, values, wanted) {
  const { index, places, normals, group } = split;
  const vertices = group.length;
  const planes = trianglePlanes(index, places);
  const { cellOf, cells, size } = gridCells(places, Math.sqrt((2 * planes.area) / wanted));
  const points = cellPoints(index, places, cellOf, cells, size, planes);

  // Vertices of one cell, group and side are one.
  const instead = new Uint32Array(vertices);
  const known = new Map();
  const cell = [];
  const groups = [];
  let most = 0;
  for (let v = 0; v < vertices; v++) most = Math.max(most, group[v]);
  for (let v = 0; v < vertices; v++) {
    const n = [normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]];
    const m = n.map(Math.abs);
    const axis = m[0] >= m[1] ? (m[0] >= m[2] ? 0 : 2) : m[1] >= m[2] ? 1 : 2;
    const key = (cellOf[v] * 6 + 2 * axis + (n[axis] < 0 ? 1 : 0)) * (most + 1) + group[v];
    let found = known.get(key);
    if (found === undefined) {
      found = cell.length;
      known.set(key, found);
      cell.push(cellOf[v]);
      groups.push(group[v]);
    }
    instead[v] = found;
  }
  const count = cell.length;
  const sums = new Float32Array(3 * count);
  const members = new Uint32Array(count);
  const value = values && new Float32Array(count);
  for (let v = 0; v < vertices; v++) {
    const to = instead[v];
    members[to]++;
    for (let k = 0; k < 3; k++) sums[3 * to + k] += normals[3 * v + k];
    if (value) value[to] += values[v];
  }
  const unit = new Int8Array(3 * count);
  for (let c = 0; c < count; c++) {
    const length = Math.hypot(sums[3 * c], sums[3 * c + 1], sums[3 * c + 2]) || 1;
    for (let k = 0; k < 3; k++) unit[3 * c + k] = Math.round((127 * sums[3 * c + k]) / length);
    if (value) value[c] /= members[c];
  }
  const kept = [];
  for (let t = 0; t < index.length; t += 3) {
    const [a, b, c] = [instead[index[t]], instead[index[t + 1]], instead[index[t + 2]]];
    if (cell[a] !== cell[b] && cell[b] !== cell[c] && cell[c] !== cell[a]) kept.push(a, b, c);
  }
  const out = new Float32Array(3 * count);
  for (let c = 0; c < count; c++) for (let k = 0; k < 3; k++) out[3 * c + k] = points[3 * cell[c] + k];
  return { split: { index: Uint32Array.from(kept), places: out, normals: unit, group: Uint32Array.from(groups) }, values: value };
}

/** Unit normals and areas of triangles. */
function trianglePlanes(index, places) {
  const faces = index.length / 3;
  const normals = new Float32Array(3 * faces);
  const areas = new Float32Array(faces);
  let area = 0;
  for (let f = 0; f < faces; f++) {
    const [a, b, c] = [3 * index[3 * f], 3 * index[3 * f + 1], 3 * index[3 * f + 2]];
    const [ux, uy, uz] = [places[b] - places[a], places[b + 1] - places[a + 1], places[b + 2] - places[a + 2]];
    const [vx, vy, vz] = [places[c] - places[a], places[c + 1] - places[a + 1], places[c + 2] - places[a + 2]];
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.hypot(x, y, z);
    areas[f] = length / 2;
    area += length / 2;
    if (length > 0) {
      normals[3 * f] = x / length;
      normals[3 * f + 1] = y / length;
      normals[3 * f + 2] = z / length;
    }
  }
  return { normals, areas, area };
}

/** The cell of each vertex, numbered as they are met. */
function gridCells(places, wantedSize) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < places.length; i++) {
    low[i % 3] = Math.min(low[i % 3], places[i]);
    high[i % 3] = Math.max(high[i % 3], places[i]);
  }
  const size = wantedSize > 0 ? wantedSize : 1;
  const [, ny, nz] = [0, 1, 2].map((k) => Math.floor((high[k] - low[k]) / size) + 1);
  const known = new Map();
  const cellOf = new Uint32Array(places.length / 3);
  for (let v = 0; v < cellOf.length; v++) {
    const x = Math.floor((places[3 * v] - low[0]) / size);
    const y = Math.floor((places[3 * v + 1] - low[1]) / size);
    const z = Math.floor((places[3 * v + 2] - low[2]) / size);
    const key = (x * ny + y) * nz + z;
    let cell = known.get(key);
    if (cell === undefined) known.set(key, (cell = known.size));
    cellOf[v] = cell;
  }
  return { cellOf, cells: known.size, size };
}

/** The point of each cell: the least sum of squared distances to the planes of its triangles, or the mean where that is elsewhere. */
function cellPoints(index, places, cellOf, cells, size, planes) {
  const points = new Float32Array(3 * cells);
  const members = new Uint32Array(cells);
  for (let v = 0; v < cellOf.length; v++) {
    members[cellOf[v]]++;
    for (let k = 0; k < 3; k++) points[3 * cellOf[v] + k] += places[3 * v + k];
  }
  for (let c = 0; c < cells; c++) for (let k = 0; k < 3; k++) points[3 * c + k] /= members[c];
  // Upper triangle of the matrix and right-hand side, about the mean.
  const q = new Float64Array(9 * cells);
  const add = (cell, f, v) => {
    const [x, y, z] = [planes.normals[3 * f], planes.normals[3 * f + 1], planes.normals[3 * f + 2]];
    const w = planes.areas[f];
    const d = w * (x * (places[3 * v] - points[3 * cell]) + y * (places[3 * v + 1] - points[3 * cell + 1]) + z * (places[3 * v + 2] - points[3 * cell + 2]));
    const at = 9 * cell;
    q[at] += w * x * x;
    q[at + 1] += w * x * y;
    q[at + 2] += w * x * z;
    q[at + 3] += w * y * y;
    q[at + 4] += w * y * z;
    q[at + 5] += w * z * z;
    q[at + 6] += d * x;
    q[at + 7] += d * y;
    q[at + 8] += d * z;
  };
  for (let t = 0; t < index.length; t += 3) {
    const f = t / 3;
    const [a, b, c] = [cellOf[index[t]], cellOf[index[t + 1]], cellOf[index[t + 2]]];
    add(a, f, index[t]);
    if (b !== a) add(b, f, index[t + 1]);
    if (c !== a && c !== b) add(c, f, index[t + 2]);
  }
  for (let cell = 0; cell < cells; cell++) {
    const at = 9 * cell;
    // Flat and straight places are held to the mean along what the planes leave open.
    const hold = 1e-3 * (q[at] + q[at + 3] + q[at + 5]);
    const [a, b, c, d, e, f] = [q[at] + hold, q[at + 1], q[at + 2], q[at + 3] + hold, q[at + 4], q[at + 5] + hold];
    const [m0, m1, m2] = [d * f - e * e, c * e - b * f, b * e - c * d];
    const determinant = a * m0 + b * m1 + c * m2;
    if (!(determinant > 0)) continue;
    const [r0, r1, r2] = [q[at + 6], q[at + 7], q[at + 8]];
    const x = (m0 * r0 + m1 * r1 + m2 * r2) / determinant;
    const y = (m1 * r0 + (a * f - c * c) * r1 + (b * c - a * e) * r2) / determinant;
    const z = (m2 * r0 + (b * c - a * e) * r1 + (a * d - b * b) * r2) / determinant;
    if (Math.hypot(x, y, z) > size) continue;
    points[3 * cell] += x;
    points[3 * cell + 1] += y;
    points[3 * cell + 2] += z;
  }
  return points;
}

/**
 * Fewer segments: along chains, on which two segments meet at each point, steps of several points; one segment from end to end
 * is left of each at the least. Nets without chains are thinned out. Pairs of points, as `segments`.
 */
function fewerLines(segments, points, wanted) {
  const count = segments.length / 2;
  if (count <= wanted) return segments;
  // Up to two segments at each point, and how many there are.
  const at = new Int32Array(2 * points).fill(-1);
  const degree = new Uint32Array(points);
  for (let i = 0; i < segments.length; i++) {
    const v = segments[i];
    if (degree[v] < 2) at[2 * v + degree[v]] = i >> 1;
    degree[v]++;
  }
  const step = Math.ceil(count / wanted);
  const used = new Uint8Array(count);
  const out = [];
  const walk = (from, segment) => {
    let [start, v, length] = [from, from, 0];
    while (segment >= 0 && !used[segment]) {
      used[segment] = 1;
      v = segments[2 * segment] === v ? segments[2 * segment + 1] : segments[2 * segment];
      if (++length % step === 0 || degree[v] !== 2) {
        out.push(start, v);
        start = v;
      }
      if (degree[v] !== 2) return;
      segment = at[2 * v] === segment ? at[2 * v + 1] : at[2 * v];
    }
    if (v !== start) out.push(start, v);
  };
  for (let s = 0; s < count; s++) {
    for (const v of [segments[2 * s], segments[2 * s + 1]]) if (degree[v] !== 2 && !used[s]) walk(v, s);
  }
  for (let s = 0; s < count; s++) if (!used[s]) walk(segments[2 * s], s);
  const thin = Math.floor(out.length / 2 / (4 * wanted)) + 1;
  return Uint32Array.from(thin === 1 ? out : out.filter((_, i) => (i >> 1) % thin === 0));
}
