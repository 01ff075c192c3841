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

/** @param {Scene} scene @param {import('./store.js').Row|null} row @param {import('./store.js').Row[]} rows */
export function showRow(scene, hello, row, rows, column) {
  const v = (name, of = row) => (of ? of.values[column[name]] : NaN);
  const at = (of) => [v('x', of), v('y', of), v('z', of)];
  const trail = rows.filter((one) => (!row || one.t <= row.t) && isFinite(v('x', one))).map(at);
  if (!row || !isFinite(v('x'))) return scene.show(null, trail);
  const q = rotation(v('yaw'), v('pitch'), v('roll'));
  const body = {p: new Vector3(...at(row)), q};
  let base = place(hello.base_from_camera);
  if (hello.pan_tilt) {
    const pan = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), (v('pan') || 0) * RAD);
    const tilt = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), (v('tilt') || 0) * RAD);
    base = {p: base.p, q: base.q.clone().multiply(pan).multiply(tilt)};
  }
  const camera = product(product(body, place(hello.body_from_base)), base);
  scene.show({position: at(row), body: [q.w, q.x, q.y, q.z],
              camera: [...camera.p.toArray(), camera.q.w, camera.q.x, camera.q.y, camera.q.z]}, trail, hello.camera.rays);
}
