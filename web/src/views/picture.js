// The picture with what was made of it: outline, edges with their residuals, labels, the pad's uncertainty.
import {element} from '../common/element.js';

// Drawn on a black line each: readable on white and on black. Okabe and Ito.
const OUTLINE = '#e69f00', MEASURED = '#56b4e9', FAR = '#ff6a4d', ELLIPSE = '#f0e442';
// A residual is drawn so many times as long as it is: they are hundredths of a pixel.
const MAGNIFIED = 60;

/**
 * @typedef {object} Overlay
 * @property {number[]} size of the whole picture, px
 * @property {number[]} part x, y, width, height of what is shown
 * @property {number[][]} outline
 * @property {[string, number, number][]} labels
 * @property {number[][]} edges x, y, normal, px left
 * @property {number[]|null} ellipse
 */

export class PictureView {
  constructor() {
    this.canvas = /** @type {HTMLCanvasElement} */ (element('canvas', {role: 'img', 'aria-label': 'the picture with the recovered target'}));
    this.element = element('div', {class: 'picture'}, this.canvas);
    this.layers = {outline: true, edges: true, labels: true};
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(this.element);
  }

  /** @param {CanvasImageSource|null} image @param {Overlay|null} overlay */
  show(image, overlay) {
    this.image = image;
    this.overlay = overlay;
    this.draw();
  }

  draw() {
    const [x, y, width, height] = this.overlay?.part ?? [0, 0, 640, 480];
    const shown = this.element.clientWidth;
    if (!shown) return;
    const ratio = Math.min(devicePixelRatio, 2);
    const scale = shown / width;
    this.canvas.width = Math.round(shown * ratio);
    this.canvas.height = Math.round(height * scale * ratio);
    const context = this.canvas.getContext('2d');
    if (!context) return;
    context.fillStyle = '#000';
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    if (this.image) context.drawImage(this.image, 0, 0, this.canvas.width, this.canvas.height);
    if (!this.overlay) return;
    // From pixels of the whole picture, integers at their centres, to those of the canvas.
    const to = (px, py) => [(px - x + 0.5) * scale, (py - y + 0.5) * scale];
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.lineJoin = 'round';
    if (this.layers.outline) this.drawOutline(context, to);
    if (this.layers.edges) this.drawEdges(context, to);
    this.drawEllipse(context, to, scale);
    if (this.layers.labels) this.drawLabels(context, to);
  }

  drawOutline(context, to) {
    for (const [width, colour] of [[3.5, '#000'], [1.6, OUTLINE]]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      for (const line of this.overlay?.outline ?? []) {
        context.beginPath();
        for (let i = 0; i < line.length; i += 2) context.lineTo(...to(line[i], line[i + 1]));
        context.stroke();
      }
    }
  }

  drawEdges(context, to) {
    for (const [px, py, nx, ny, left] of this.overlay?.edges ?? []) {
      const [x, y] = to(px, py);
      const length = Math.max(-40, Math.min(40, MAGNIFIED * left));
      for (const [width, colour] of [[4, '#000'], [2, Math.abs(left) > 0.3 ? FAR : MEASURED]]) {
        context.lineWidth = width;
        context.strokeStyle = colour;
        context.beginPath();
        context.moveTo(x, y);
        context.lineTo(x + nx * length, y + ny * length);
        context.stroke();
      }
      context.fillStyle = MEASURED;
      context.fillRect(x - 1.5, y - 1.5, 3, 3);
    }
  }

  // One sigma; so small mostly that a cross has to say where it is.
  drawEllipse(context, to, scale) {
    if (!this.overlay?.ellipse) return;
    const [px, py, a, b, angle] = this.overlay.ellipse;
    const [x, y] = to(px, py);
    for (const [width, colour] of [[4, '#000'], [2, ELLIPSE]]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.beginPath();
      context.ellipse(x, y, Math.max(a * scale, 0.5), Math.max(b * scale, 0.5), angle, 0, 2 * Math.PI);
      for (const [dx, dy] of [[1, 0], [0, 1], [-1, 0], [0, -1]]) {
        context.moveTo(x + 5 * dx, y + 5 * dy);
        context.lineTo(x + 11 * dx, y + 11 * dy);
      }
      context.stroke();
    }
  }

  // Names nearer to each other than they are wide would be a smear.
  drawLabels(context, to) {
    const taken = [];
    context.font = '600 11px system-ui, sans-serif';
    context.lineWidth = 3;
    context.strokeStyle = '#000';
    context.fillStyle = '#fff';
    for (const [name, px, py] of this.overlay?.labels ?? []) {
      const [x, y] = to(px, py);
      if (taken.some(([u, v]) => Math.abs(u - x) < 20 && Math.abs(v - y) < 12)) continue;
      taken.push([x, y]);
      context.strokeText(name, x + 4, y - 4);
      context.fillText(name, x + 4, y - 4);
    }
  }
}
