// Geometry as it stands in the page: base 64, deflated, and then arrays of differences (see encode.rs).

/** The bytes of the geometry, which stand in pieces. */
async function unpack(text, length) {
  const pieces = text.split(' ').filter(Boolean).map(async (piece) => {
    const packed = Uint8Array.from(atob(piece), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  });
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const piece of await Promise.all(pieces)) {
    if (at + piece.length > length) throw new Error('the geometry is longer than it should be');
    bytes.set(piece, at);
    at += piece.length;
  }
  if (at !== length) throw new Error(`the geometry has ${at} bytes and should have ${length}`);
  return bytes;
}

/** `count` 16-bit numbers from `at` on. */
function readShorts(bytes, at, count) {
  const values = new Uint16Array(count);
  let value = 0;
  for (let k = 0; k < count; k++) {
    const folded = (bytes[at + k] << 8) | bytes[at + count + k];
    value = (value + ((folded >> 1) ^ -(folded & 1))) & 0xffff;
    values[k] = value;
  }
  return values;
}

/** Points as x, y, z, x, y, z ... in mm. */
function readPositions(bytes, block, header) {
  const points = new Float32Array(3 * block.count);
  for (let axis = 0; axis < 3; axis++) {
    const step = (header.high[axis] - header.low[axis]) / 65535;
    const values = readShorts(bytes, block.at + 2 * axis * block.count, block.count);
    for (let k = 0; k < block.count; k++) points[3 * k + axis] = header.low[axis] + values[k] * step;
  }
  return points;
}

/** Whole numbers. */
function readIntegers(bytes, block) {
  const values = new Uint32Array(block.count);
  let at = block.at;
  let value = 0;
  for (let k = 0; k < block.count; k++) {
    let folded = 0;
    let factor = 1;
    let byte;
    do {
      byte = bytes[at++];
      folded += (byte & 0x7f) * factor;
      factor *= 128;
    } while (byte >= 0x80);
    value += folded % 2 ? -(folded + 1) / 2 : folded / 2;
    values[k] = value;
  }
  return values;
}

/** The values of a field. */
function readField(bytes, field) {
  const step = (field.high - field.low) / 65535;
  return Float32Array.from(readShorts(bytes, field.values.at, field.values.count), (v) => field.low + v * step);
}
