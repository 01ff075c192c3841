// The black-and-white picture of perch/station/bit_picture.h.

/** @param {Uint8Array} bytes @returns {{width: number, height: number, white: Uint8Array}|null} */
export function unpackBits(bytes) {
  if (bytes.length < 5) return null;
  const width = bytes[0] + 256 * bytes[1], height = bytes[2] + 256 * bytes[3];
  const white = new Uint8Array(width * height);
  if (bytes[4] === 0) {
    for (let i = 0; i < white.length; ++i) white[i] = (bytes[5 + (i >> 3)] >> (7 - (i & 7))) & 1;
    return {width, height, white};
  }
  let colour = 0, at = 0;
  for (let i = 5; i < bytes.length; ++i) {
    let length = 0, shift = 0;
    for (; bytes[i] & 128; ++i, shift += 7) length |= (bytes[i] & 127) << shift;
    length |= bytes[i] << shift;
    white.fill(colour, at, at + length);
    at += length;
    colour = 1 - colour;
  }
  return {width, height, white};
}
