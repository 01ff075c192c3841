// What came in the last five minutes: rows of the estimator and pictures, by time.
const KEPT_S = 300;

/**
 * @typedef {object} Row
 * @property {number} sequence
 * @property {bigint} ns on the camera's clock
 * @property {number} t s since the first row that came
 * @property {number} status index of STATUSES
 * @property {number} source 0: none yet, 1 vision, 2 predicted, 3 lost
 * @property {Float32Array} values
 */

export class Store {
  constructor() {
    /** @type {Row[]} */
    this.rows = [];
    /** @type {{t: number, ns: bigint, overlay: any, jpeg: Blob|null, bits: Uint8Array|null}[]} */
    this.pictures = [];
    /** @type {bigint|null} */
    this.zero = null;
  }

  clear() {
    this.rows = [];
    this.pictures = [];
    this.zero = null;
  }

  seconds(ns) {
    const zero = this.zero ??= ns;
    return Number(ns - zero) * 1e-9;
  }

  // The number after the last row that is here, to ask from.
  get next() { return this.rows.length ? this.rows[this.rows.length - 1].sequence + 1 : 0; }
  get last() { return this.rows[this.rows.length - 1] ?? null; }

  // A message of rows (perch/station/state_row.h): u8 1, u8 nothing missed is left, u16 0, then the rows.
  addRows(buffer, rowBytes) {
    const view = new DataView(buffer);
    const added = [];
    for (let at = 4; at + rowBytes <= buffer.byteLength; at += rowBytes) {
      const ns = view.getBigInt64(at + 8, true);
      const values = new Float32Array((rowBytes - 16) / 4);
      for (let i = 0; i < values.length; ++i) values[i] = view.getFloat32(at + 16 + 4 * i, true);
      added.push({sequence: view.getUint32(at, true), ns, t: this.seconds(ns), status: view.getUint8(at + 4), source: view.getUint8(at + 5), values});
    }
    this.merge(added);
  }

  // Mostly newer than all; what fills a gap comes later than its time.
  merge(added) {
    if (!added.length) return;
    const sorted = !this.rows.length || added[0].sequence > this.rows[this.rows.length - 1].sequence;
    this.rows.push(...added);
    if (!sorted) {
      const bySequence = new Map(this.rows.map((row) => [row.sequence, row]));
      this.rows = [...bySequence.values()].sort((a, b) => a.sequence - b.sequence);
    }
    const oldest = this.rows[this.rows.length - 1].t - KEPT_S;
    const gone = this.rows.findIndex((row) => row.t >= oldest);
    if (gone > 200) this.rows.splice(0, gone);
    while (this.pictures.length && this.pictures[0].t < oldest) this.pictures.shift();
  }

  // A whole picture (perch/station/picture_message.h).
  addPicture(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const overlay = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    const ns = BigInt(overlay.t);
    const jpegAt = 4 + length, bitsAt = jpegAt + overlay.jpeg;
    this.pictures.push({
      t: this.seconds(ns), ns, overlay,
      jpeg: overlay.jpeg ? new Blob([new Uint8Array(buffer, jpegAt, overlay.jpeg)], {type: 'image/jpeg'}) : null,
      bits: overlay.bits ? new Uint8Array(buffer.slice(bitsAt, bitsAt + overlay.bits)) : null,
    });
  }

  // The last of a list at or before a time; null when there is none.
  static upTo(list, t) {
    let low = 0, high = list.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (list[middle].t <= t) low = middle + 1;
      else high = middle;
    }
    return low ? list[low - 1] : null;
  }
  rowAt(t) { return Store.upTo(this.rows, t); }
  pictureAt(t) { return Store.upTo(this.pictures, t); }

  between(from, to) {
    return this.rows.filter((row) => row.t >= from && row.t <= to);
  }
}
