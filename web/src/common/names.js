// What the states and statuses are called, in their order in the data, and how they look.
import {theme} from './theme.js';

export const STATES = ['x', 'y', 'z', 'yaw', 'pitch', 'roll'];
export const isAngle = (i) => i >= 3;

// Colours of Okabe and Ito: told apart by the colour-blind.
export const STATUSES = [
  {name: 'ok', words: 'pose', colour: '#009e73'},
  {name: 'no_target', words: 'no target', colour: '#8c8c8c'},
  {name: 'partial', words: 'partial', colour: '#e6b800'},
  {name: 'ambiguous', words: 'ambiguous', colour: '#cc79a7'},
  {name: 'rejected', words: 'rejected', colour: '#d55e00'},
  {name: 'unreadable', words: 'unreadable', colour: '#3b3b3b'},
];

// Dark grey is lost on a dark page.
export const statusColour = (i) => (i === 5 ? theme('text') : STATUSES[i].colour);

// Angles that pass +-180 degrees go on, so that no line crosses the whole plot: each is put next to `anchor`
// where there is one, else next to the last.
export function unwrap(angles, anchor) {
  let last = null;
  return angles.map((angle, i) => {
    if (angle == null) return null;
    const near = anchor && anchor[i] != null ? anchor[i] : last;
    last = near == null ? angle : angle + 360 * Math.round((near - angle) / 360);
    return last;
  });
}
