// The black-and-white picture that a threshold makes of the camera's.
import {element} from '../common/element.js';

export class BinaryView {
  constructor() {
    this.canvas = /** @type {HTMLCanvasElement} */ (element('canvas', {class: 'pixels', width: '160', height: '120', role: 'img', 'aria-label': 'the picture in black and white'}));
    this.element = element('div', {class: 'binary'}, this.canvas);
  }

  /** @param {{width: number, height: number, white: Uint8Array}|null} bits */
  show(bits) {
    const context = this.canvas.getContext('2d');
    if (!context) return;
    if (!bits) return context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.canvas.width = bits.width;
    this.canvas.height = bits.height;
    const image = context.createImageData(bits.width, bits.height);
    bits.white.forEach((white, i) => image.data.fill(white ? 255 : 0, 4 * i, 4 * i + 3));
    for (let i = 3; i < image.data.length; i += 4) image.data[i] = 255;
    context.putImageData(image, 0, 0);
  }
}
