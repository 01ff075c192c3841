export const DEG = 180 / Math.PI;

// All digits that tell something, none that do not: 0.0123, 1.23, 123.
export function short(value) {
  if (value == null || !isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size >= 1e5 || (size > 0 && size < 1e-4)) return value.toExponential(1).replace('-', '−');
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : size >= 0.1 ? 3 : 4;
  return value.toFixed(digits).replace('-', '−');
}

// So many decimals, with a minus sign that is one.
export const fixed = (value, digits) => (value == null || !isFinite(value) ? '–' : value.toFixed(digits).replace('-', '−'));
