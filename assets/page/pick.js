// Whose arm is at a point of the scene: told by its colour, since the viewer hears of no clicks.

import { pixelsOf } from "./picture.js";

/** So far around the point pixels count, CSS pixels. */
const AROUND = 6;
/** The least part of these pixels that must be of an arm. */
const LEAST = 0.04;
/** How far a pixel's colour may be from an arm's, both of length 1: light and shade change the length. */
const NEAR = 0.24;
const GREY = Array(3).fill(1 / Math.sqrt(3));
/** Frames in which the viewer must have drawn. */
const FRAMES = 30;

/**
 * @param {HTMLCanvasElement} scene
 * @param {[number, number]} at CSS pixels from its upper left corner
 * @param {{name: string, colour: number[]}[]} learners
 * @param {() => void} redraw makes the viewer draw
 * @returns {Promise<string | null>} the learner's name; null if there is no arm of a learner's
 */
export async function armAt(scene, [x, y], learners, redraw) {
  const pixels = await around(scene, [x, y], redraw);
  if (pixels.length === 0) return null;
  const colours = learners.map(({ colour }) => direction(colour));
  const votes = learners.map(() => 0);
  for (let index = 0; index < pixels.length; index += 4) {
    const colour = direction([...pixels.slice(index, index + 3)]);
    const distances = colours.map((other) => distance(colour, other));
    const nearest = distances.indexOf(Math.min(...distances));
    if (distances[nearest] < Math.min(NEAR, distance(colour, GREY))) votes[nearest] += 1;
  }
  const most = Math.max(...votes);
  return most >= (LEAST * pixels.length) / 4 ? learners[votes.indexOf(most)].name : null;
}

/** The pixels around a point. */
async function around(scene, [x, y], redraw) {
  const scale = scene.width / scene.clientWidth;
  const side = Math.max(1, Math.round(2 * AROUND * scale));
  const pen = Object.assign(document.createElement("canvas"), { width: side, height: side }).getContext("2d", {
    willReadFrequently: true,
  });
  const part = [(x - AROUND) * scale, (y - AROUND) * scale, side, side];
  const isDrawn = (pixels) => pixels.some((value, index) => index % 4 === 3 && value > 0);
  return (await pixelsOf(pen, scene, part, redraw, isDrawn, FRAMES)) ?? [];
}

function direction(colour) {
  const length = Math.hypot(...colour);
  return length === 0 ? GREY : colour.map((part) => part / length);
}

const distance = (one, other) => Math.hypot(...one.map((part, index) => part - other[index]));
