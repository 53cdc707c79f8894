// A picture of the scene with its caption, to be passed on.

import { saveBlob } from "./save.js";

/** Frames in which the viewer must have drawn. */
const FRAMES = 60;
const MARGIN = 16;
const LINE = 22;

/**
 * The scene as a picture in PNG.
 * @param {HTMLCanvasElement} scene
 * @param {number} cut how much of the scene's upper edge is hidden on the page, CSS pixels
 * @param {{title: string, learners: {name: string, errors: string, colour: number[]}[]}} caption
 * @param {[string, string][]} legend what the other colours mean: text and colour
 * @param {() => void} redraw makes the viewer draw
 * @returns {Promise<Blob>}
 */
export async function picture(scene, cut, caption, legend, redraw) {
  const scale = scene.width / scene.clientWidth;
  const width = scene.width;
  const height = Math.round(scene.height - cut * scale);
  const lines = 2;
  const canvas = Object.assign(document.createElement("canvas"), {
    width,
    height: height + Math.round((lines * LINE + MARGIN) * scale),
  });
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  const style = getComputedStyle(document.documentElement);
  pen.fillStyle = style.backgroundColor;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  await drawn(pen, scene, [0, Math.round(cut * scale), width, height], redraw);
  pen.scale(scale, scale);
  pen.font = "14px system-ui, sans-serif";
  pen.textBaseline = "middle";
  const colour = style.color;
  const learners = caption.learners.map(({ name, errors, colour }) => [`${name} ${errors}`, `rgb(${colour.join(" ")})`]);
  const bottom = height / scale + MARGIN / 2;
  write(pen, bottom + LINE / 2, colour, [[caption.title, null], ...learners]);
  write(pen, bottom + LINE * 1.5, colour, [["body-schema", null], ...legend]);
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => (blob === null ? reject(new Error("no picture")) : resolve(blob)), "image/png");
  });
}

/** Copies the scene. */
async function drawn(pen, scene, part, redraw) {
  const isDrawn = (pixels) => {
    for (let index = 0; index < pixels.length; index += 4 * 101) {
      if ([0, 1, 2].some((channel) => pixels[index + channel] !== pixels[channel])) return true;
    }
    return false;
  };
  if ((await pixelsOf(pen, scene, part, redraw, isDrawn, FRAMES)) === null) throw new Error("the scene has drawn nothing");
}

/**
 * Copies a part of the scene in a frame in which the viewer has drawn: afterwards its canvas reads as empty.
 * @param {CanvasRenderingContext2D} pen where it is copied to
 * @param {HTMLCanvasElement} scene
 * @param {[number, number, number, number]} part the scene's pixels: left, top, width, height
 * @param {() => void} redraw makes the viewer draw
 * @param {(pixels: Uint8ClampedArray) => boolean} isDrawn whether it has
 * @param {number} frames it has so many to do so
 * @returns {Promise<Uint8ClampedArray | null>} the pixels, four numbers each; null if it has not
 */
export async function pixelsOf(pen, scene, [x, y, width, height], redraw, isDrawn, frames) {
  for (let frame = 0; frame < frames; frame++) {
    redraw();
    // A callback that is asked for outside of a frame comes after the viewer's own of the next one.
    await new Promise((resolve) => setTimeout(() => requestAnimationFrame(resolve)));
    pen.drawImage(scene, x, y, width, height, 0, 0, width, height);
    const pixels = pen.getImageData(0, 0, width, height).data;
    if (isDrawn(pixels)) return pixels;
  }
  return null;
}

/** Writes texts side by side, each after a dot of its colour, as many as there is room for. */
function write(pen, y, colour, texts) {
  let x = MARGIN;
  for (const [text, dot] of texts) {
    if (dot !== null) {
      pen.fillStyle = dot;
      pen.beginPath();
      pen.arc(x + 5, y, 5, 0, 2 * Math.PI);
      pen.fill();
      x += 15;
    }
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
    x += pen.measureText(text).width + MARGIN;
  }
}

/**
 * Puts a picture on the clipboard, or offers it as a file where that is refused.
 * @param {Promise<Blob>} blob
 * @returns {Promise<string>} what was done with it
 */
export async function passOn(blob, name) {
  try {
    // The clipboard is asked at once, while the visitor's click still counts.
    await navigator.clipboard.write([new ClipboardItem({ "image/png": blob })]);
    return "The picture is on the clipboard.";
  } catch {
    saveBlob(await blob, name);
    return "The picture was saved as a file.";
  }
}
