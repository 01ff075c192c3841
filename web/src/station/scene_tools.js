// The 3-D view of a row; with three.js in a file of its own.
import {Quaternion, Vector3} from 'three';
import {place, product, Scene} from '../views/scene.js';

export {Scene};

const RAD = Math.PI / 180;

// ZYX Euler angles, as perch/geometry/euler.h has them.
function rotation(yaw, pitch, roll) {
  const about = (x, y, z, angle) => new Quaternion().setFromAxisAngle(new Vector3(x, y, z), angle * RAD);
  return about(0, 0, 1, yaw).multiply(about(0, 1, 0, pitch)).multiply(about(1, 0, 0, roll));
}

// A head's axis at its reading, in degrees: perch/frames/frame_chain.h's head_turn.
function headTurn({direction, point, scale, zero_deg: zero}, reading) {
  const q = new Quaternion().setFromAxisAngle(new Vector3(...direction), (scale * reading + zero) * RAD);
  const through = new Vector3(...point);
  return {p: through.clone().sub(through.clone().applyQuaternion(q)), q};
}

// Where the camera is in its base; null while nobody knows where the head looks.
function baseFromCamera(hello, pan, tilt) {
  const base = place(hello.base_from_camera), head = hello.pan_tilt;
  if (!head) return base;
  if (!isFinite(pan) || !isFinite(tilt)) return null;
  const turns = [headTurn(head.pan, pan), headTurn(head.tilt, tilt)];
  if (!head.pan_carries_tilt) turns.reverse();
  return turns.reduce(product, base);
}

/** @param {Scene} scene @param {import('./store.js').Row|null} row @param {import('./store.js').Row[]} rows */
export function showRow(scene, hello, row, rows, column) {
  const v = (name, of = row) => (of ? of.values[column[name]] : NaN);
  const at = (of) => [v('x', of), v('y', of), v('z', of)];
  const trail = rows.filter((one) => (!row || one.t <= row.t) && isFinite(v('x', one))).map(at);
  if (!row || !isFinite(v('x'))) return scene.show(null, trail);
  const q = rotation(v('yaw'), v('pitch'), v('roll'));
  const body = {p: new Vector3(...at(row)), q};
  const base = baseFromCamera(hello, v('pan'), v('tilt'));
  const camera = base && product(product(body, place(hello.body_from_base)), base);
  scene.show({position: at(row), body: [q.w, q.x, q.y, q.z],
              camera: camera ? [...camera.p.toArray(), camera.q.w, camera.q.x, camera.q.y, camera.q.z] : undefined}, trail, hello.camera.rays);
}
