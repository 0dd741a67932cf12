"use strict";
// The run as columns, and the row at a time. Column names and order come from the page's data.

/** Modes of contact, states of the controller: names by number, with the colour's CSS variable. */
const MODES = [["flight", "--red"], ["slide +", "--blue"], ["slide −", "--sky"], ["stick", "--green"]];
const STATES = [["idle", "--faint"], ["armed", "--orange"], ["tracking", "--green"], ["lift-off", "--red"], ["fault", "--purple"]];
const FLAGS = { contact: 1, saturated: 2, done: 4, edge: 16, recovering: 32, negative: 64, sticks: 128 };

/** Columns that follow from others. */
const DERIVED = ["friction_low", "friction_high"];

/** Rows of 8-byte time, 4-byte numbers and single bytes, in columns that grow. */
class Columns {
  constructor(names, bytes) {
    this.names = names;
    this.byteNames = bytes;
    this.rowBytes = 8 + 4 * names.length + bytes.length;
    this.length = 0;
    this.room = 1024;
    this.t = new Float64Array(this.room);
    for (const name of names) this[name] = new Float32Array(this.room);
    for (const name of bytes) this[name] = new Uint8Array(this.room);
    for (const name of DERIVED) this[name] = new Float32Array(this.room);
    this.all = ["t", ...names, ...bytes, ...DERIVED];
  }

  /** Appends the rows in a buffer; the oldest rows go once there are more than `most`. */
  append(buffer, most = Infinity) {
    const view = new DataView(buffer);
    const rows = Math.floor(buffer.byteLength / this.rowBytes);
    this.reserve(this.length + rows);
    const { friction, friction_deviation, friction_low, friction_high } = this;
    for (let row = 0, at = 0; row < rows; row++, at += this.rowBytes) {
      const i = this.length++;
      this.t[i] = view.getFloat64(at, true);
      this.names.forEach((name, k) => { this[name][i] = view.getFloat32(at + 8 + 4 * k, true); });
      this.byteNames.forEach((name, k) => { this[name][i] = view.getUint8(at + 8 + 4 * this.names.length + k); });
      friction_low[i] = friction[i] - friction_deviation[i];
      friction_high[i] = friction[i] + friction_deviation[i];
    }
    if (this.length > 1.25 * most) this.drop(this.length - most);
  }

  reserve(length) {
    if (length <= this.room) return;
    while (this.room < length) this.room *= 2;
    for (const name of this.all) {
      const grown = new this[name].constructor(this.room);
      grown.set(this[name].subarray(0, this.length));
      this[name] = grown;
    }
  }

  drop(rows) {
    for (const name of this.all) this[name].copyWithin(0, rows, this.length);
    this.length -= rows;
  }

  clear() { this.length = 0; }

  get start() { return this.length ? this.t[0] : 0; }
  get end() { return this.length ? this.t[this.length - 1] : 0; }

  /** Index of the last row at or before a time. */
  index(time) {
    let low = 0, high = this.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.t[middle] <= time) low = middle; else high = middle - 1;
    }
    return Math.max(low, 0);
  }

  /** Value of a column at a time, interpolated between rows. */
  at(name, time) {
    if (!this.length) return NaN;
    const i = this.index(time), j = Math.min(i + 1, this.length - 1);
    const a = this[name][i], b = this[name][j], gap = this.t[j] - this.t[i];
    const part = gap > 0 ? Math.min(Math.max((time - this.t[i]) / gap, 0), 1) : 0;
    return Number.isFinite(b) ? a + (b - a) * part : a;
  }

  /** A column for a logarithmic axis between two limits, with a gap where a value is not positive. */
  positive(name, scale, limits) {
    return this.chart(name, scale).map((value) => onLogarithm(value, limits));
  }

  /** A column at the times of other columns, which are later by `shift`; with a gap where this run has no row. */
  resampled(name, onto, shift, scale, limits) {
    const values = new Array(onto.length);
    for (let i = 0; i < onto.length; i++) {
      const time = onto.t[i] - shift, value = this.at(name, time) * scale;
      const known = time >= this.start - 1e-9 && time <= this.end + 1e-9 && Number.isFinite(value);
      values[i] = known ? (limits ? onLogarithm(value, limits) : value) : null;
    }
    return values;
  }

  /** A column for uPlot, with a gap where a value is not finite. */
  chart(name, scale = 1) {
    const values = new Array(this.length);
    for (let i = 0; i < this.length; i++) {
      const value = this[name][i];
      values[i] = Number.isFinite(value) ? value * scale : null;
    }
    return values;
  }
}

/** A value on a logarithmic axis; null if it has none. */
function onLogarithm(value, [least, most]) {
  return !(value > 0) ? null : Math.min(Math.max(value, least), most);
}

function bytesOfBase64(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes.buffer;
}

function decimals(value, digits, unit) {
  return Number.isFinite(value) ? `${fixed(value, digits)} ${unit}` : "–";
}

/** A number with a minus sign of its own, and none before zero. */
function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** A colour of the present theme. */
function ink(variable) { return getComputedStyle(document.documentElement).getPropertyValue(variable).trim(); }
