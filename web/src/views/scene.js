// The pad, the vehicle, what its camera sees and the way it came, in 3-D. Frames are those of docs/FORMATS.md: the
// pad's z axis is up on the screen. Drag to turn, wheel or pinch to zoom.
import {
  AxesHelper, BufferAttribute, BufferGeometry, CylinderGeometry, DoubleSide, GridHelper, Group, Line, LineBasicMaterial, LineSegments,
  Mesh, MeshBasicMaterial, PerspectiveCamera, Points, PointsMaterial, Quaternion, Scene as World, Vector3, WebGLRenderer,
} from 'three';
import {theme} from '../common/theme.js';
import {element} from '../common/element.js';

const MOST_TRAIL = 3000;

/**
 * @typedef {object} SceneFrame
 * @property {number[]} position of the body in the pad frame, m
 * @property {number[]} [body] quaternion w x y z of pad_from_body
 * @property {number[]} [camera] x y z, w x y z of pad_from_camera
 */

// Of a transform [x, y, z, w, x, y, z].
export const place = (t) => ({p: new Vector3(t[0], t[1], t[2]), q: new Quaternion(t[4], t[5], t[6], t[3])});
export const product = (a, b) => ({p: b.p.clone().applyQuaternion(a.q).add(a.p), q: a.q.clone().multiply(b.q)});

export class Scene {
  constructor() {
    this.element = element('div', {class: 'scene', role: 'img', 'aria-label': 'pad, vehicle, camera and trail in 3-D'});
    this.world = new World();
    this.eye = new PerspectiveCamera(45, 1, 0.01, 1000);
    this.eye.up.set(0, 0, 1);
    this.turn = {azimuth: -0.9, height: 0.45, distance: 0, centre: new Vector3(0, 0, 0.5)};
    this.size = 1;
    /** @type {WebGLRenderer|null} */
    this.renderer = null;
    this.vehicle = vehicle();
    this.cone = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
    this.trail = new Line(new BufferGeometry(), new LineBasicMaterial());
    this.points = new Points(new BufferGeometry(), new PointsMaterial({size: 3, sizeAttenuation: false}));
    try {
      this.renderer = new WebGLRenderer({antialias: true, alpha: true, preserveDrawingBuffer: true});
    } catch {
      this.element.append(element('p', {class: 'note'}, 'This browser shows no 3-D (WebGL).'));
      return;
    }
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.element.append(this.renderer.domElement);
    this.trail.frustumCulled = this.cone.frustumCulled = this.points.frustumCulled = false;
    this.world.add(this.vehicle, this.cone, this.trail, this.points);
    this.listen();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.element);
    this.recolour();
  }

  dispose() {
    this.observer?.disconnect();
    this.renderer?.dispose();
  }

  /** As perch/analysis/pad_json.h says it. @param {{size: number, patches: {corners: number[], white: boolean}[], pad_from_target: number[]}} what */
  setPad({size, patches, pad_from_target: fromTarget}) {
    if (!this.renderer) return;
    this.size = size;
    this.turn.distance ||= 5 * size;
    if (this.pad) this.world.remove(this.pad);
    const pad = this.pad = new Group();
    patches.forEach(({corners, white}, i) => {
      const geometry = new BufferGeometry();
      // A hair above the one below.
      const points = [0, 1, 2, 3].flatMap((k) => [corners[2 * k], corners[2 * k + 1], 0.001 * size * (i + 1)]);
      geometry.setAttribute('position', new BufferAttribute(new Float32Array(points), 3));
      geometry.setIndex([0, 1, 2, 0, 2, 3]);
      pad.add(new Mesh(geometry, new MeshBasicMaterial({color: white ? 0xf4f4f4 : 0x111111, side: DoubleSide})));
    });
    const {p, q} = place(fromTarget);
    this.pad.position.copy(p);
    this.pad.quaternion.copy(q);
    this.world.add(this.pad);
    if (this.grid) this.world.remove(this.grid);
    this.grid = new GridHelper(20 * size, 20);
    this.grid.rotation.x = Math.PI / 2;
    this.grid.position.z = -0.002 * size;
    this.grid.material.transparent = true;
    this.grid.material.opacity = 0.35;
    const axes = new AxesHelper(0.7 * size);
    axes.position.z = 0.02 * size;
    this.pad.add(axes);
    this.world.add(this.grid);
    this.vehicle.scale.setScalar(0.5 * size);
    this.recolour();
  }

  recolour() {
    if (!this.renderer) return;
    /** @type {any} */ (this.trail.material).color.set(theme(this.overlaid ? 'navigation' : 'vision'));
    /** @type {any} */ (this.points.material).color.set(theme('vision'));
    /** @type {any} */ (this.cone.material).color.set(theme('navigation'));
    for (const part of this.vehicle.children) /** @type {any} */ (part).material.color.set(theme(part.userData.nose ? 'vision' : 'text'));
    this.grid?.material.color.set(theme('muted'));
    this.draw();
  }

  /** @param {SceneFrame|null} frame what is now  @param {number[][]} trail positions, m  @param {(number[]|null)[]} [rays] of the picture's corners */
  show(frame, trail, rays) {
    if (!this.renderer) return;
    const step = Math.max(1, Math.ceil(trail.length / MOST_TRAIL));
    const points = trail.filter((p, i) => i % step === 0 || i === trail.length - 1);
    replace(this.trail, points.flat());
    this.vehicle.visible = !!frame;
    this.cone.visible = !!frame?.camera && !!rays?.every((ray) => ray);
    if (frame) {
      this.vehicle.position.set(frame.position[0], frame.position[1], frame.position[2]);
      if (frame.body) this.vehicle.quaternion.set(frame.body[1], frame.body[2], frame.body[3], frame.body[0]);
      // The middle between pad and vehicle, and so far away that both are seen.
      this.turn.centre.set(frame.position[0] / 2, frame.position[1] / 2, frame.position[2] / 2);
      this.reach = Math.hypot(...frame.position);
    }
    if (this.cone.visible && frame?.camera && rays) replace(this.cone, coneLines(place(frame.camera), rays, Math.abs(frame.camera[2])));
    this.draw();
  }

  // Instead of show(): two paths in the pad frame over each other, one as a line, one as points, all of both in sight.
  overlay(navigation, vision) {
    if (!this.renderer) return;
    this.overlaid = true;
    this.vehicle.visible = this.cone.visible = false;
    // The line is a pixel wide: over the points, it can be seen.
    this.trail.renderOrder = 1;
    /** @type {any} */ (this.trail.material).depthTest = false;
    replace(this.trail, navigation.flat());
    replace(this.points, vision.flat());
    /** @type {any} */ (this.points.material).size = vision.length < 100 ? 8 : 4;
    const all = [...navigation, ...vision, [0, 0, 0]];
    const low = [0, 1, 2].map((k) => Math.min(...all.map((p) => p[k]))), high = [0, 1, 2].map((k) => Math.max(...all.map((p) => p[k])));
    this.turn.centre.set((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
    this.reach = 0.75 * Math.hypot(...[0, 1, 2].map((k) => high[k] - low[k]));
    this.recolour();
  }

  draw() {
    if (!this.renderer || !this.eye.aspect) return;
    const {azimuth, height, centre} = this.turn;
    const far = (this.zoomed ?? 1) * Math.max(4 * this.size, 1.9 * (this.reach ?? 0));
    this.eye.position.set(Math.cos(azimuth) * Math.cos(height), Math.sin(azimuth) * Math.cos(height), Math.sin(height)).multiplyScalar(far).add(centre);
    this.eye.lookAt(centre);
    this.renderer.render(this.world, this.eye);
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.element;
    if (!width || !height) return;
    this.renderer?.setSize(width, height);
    this.eye.aspect = width / height;
    this.eye.updateProjectionMatrix();
    this.draw();
  }

  listen() {
    const canvas = this.renderer?.domElement;
    if (!canvas) return;
    const fingers = new Map();
    canvas.addEventListener('pointerdown', (event) => {
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    const up = (event) => fingers.delete(event.pointerId);
    canvas.addEventListener('pointerup', up);
    canvas.addEventListener('pointercancel', up);
    canvas.addEventListener('pointermove', (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
      const before = fingers.size === 2 ? spread() : 0;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 2) return this.zoom(before / Math.max(1, spread()));
      this.turnBy(-0.008 * (event.clientX - last[0]), 0.008 * (event.clientY - last[1]));
    });
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.001 * event.deltaY));
    }, {passive: false});
  }

  turnBy(azimuth, height) {
    this.turn.azimuth += azimuth;
    this.turn.height = Math.min(1.55, Math.max(-0.1, this.turn.height + height));
    this.draw();
  }

  zoom(factor) {
    this.zoomed = Math.min(8, Math.max(0.1, (this.zoomed ?? 1) * factor));
    this.draw();
  }
}

function replace(line, numbers) {
  line.geometry.dispose();
  line.geometry = new BufferGeometry();
  line.geometry.setAttribute('position', new BufferAttribute(new Float32Array(numbers), 3));
}

// From the camera to where its picture's corners meet the ground, at most; and around there.
function coneLines(camera, rays, height) {
  const ends = rays.map((ray) => {
    const direction = new Vector3(...ray).applyQuaternion(camera.q);
    const toGround = direction.z < -0.05 ? camera.p.z / -direction.z : Infinity;
    return direction.multiplyScalar(Math.min(toGround, 2.5 * height)).add(camera.p);
  });
  const lines = [];
  ends.forEach((end, i) => {
    const next = ends[(i + 1) % ends.length];
    lines.push(...camera.p.toArray(), ...end.toArray(), ...end.toArray(), ...next.toArray());
  });
  return lines;
}

// Four arms with rings; the nose, +x of the body, in colour. Of unit size.
function vehicle() {
  const group = new Group();
  const part = (geometry, nose = false) => {
    const mesh = new Mesh(geometry, new MeshBasicMaterial());
    mesh.userData.nose = nose;
    group.add(mesh);
    return mesh;
  };
  for (const [x, y] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
    const arm = part(new CylinderGeometry(0.04, 0.04, 1.1, 6), x > 0);
    arm.position.set(0.35 * x, 0.35 * y, 0);
    arm.rotation.z = Math.atan2(y, x) + Math.PI / 2;
    const rotor = part(new CylinderGeometry(0.32, 0.32, 0.03, 24), x > 0);
    rotor.rotation.x = Math.PI / 2;
    rotor.position.set(0.72 * x, 0.72 * y, 0);
    rotor.material.transparent = true;
    rotor.material.opacity = 0.55;
  }
  const hull = part(new CylinderGeometry(0.24, 0.24, 0.16, 16));
  hull.rotation.x = Math.PI / 2;
  return group;
}
