// What the scene's canvas is spared: whatever of the viewer would take it apart, or speak of its inner workings.

/** The height of the viewer's bar of tabs, which the page cuts off, CSS pixels; as in page.css. */
export const CUT = 24;
/** A press that has moved so far is a drag, to the viewer and to everybody, CSS pixels. */
const DRAG = 8;
/** So long after the wheel's last turn the viewer has zoomed, ms. */
const WHEEL_RESTS_MS = 400;

/**
 * Keeps from the viewer what would change the arrangement, select something or show texts at the pointer; what turns,
 * moves and zooms the camera is left.
 * @param {HTMLElement} scene
 * @param {HTMLCanvasElement} canvas the viewer's, in it
 * @param {(x: number, y: number) => void} clicked is told of clicks, by CSS pixels from the canvas's upper left corner
 */
export function atScene(scene, canvas, clicked) {
  const swallow = (event) => {
    event.stopImmediatePropagation();
    event.preventDefault();
  };
  // Files that are dropped, or addresses that are pasted, would be opened; menus and double clicks select and hide.
  for (const name of ["dragenter", "dragover", "drop", "contextmenu", "dblclick"]) {
    scene.addEventListener(name, swallow, { capture: true });
  }
  for (const name of ["paste", "cut", "copy"]) {
    const swallowAtScene = (event) => scene.contains(document.activeElement) && event.stopImmediatePropagation();
    addEventListener(name, swallowAtScene, { capture: true });
  }
  onlyTheCamera(scene, canvas);
  onClicks(scene, canvas, clicked);
}

/** Tells of clicks and taps, of which the viewer does not hear. */
function onClicks(scene, canvas, clicked) {
  let pressed = null;
  const capture = { capture: true };
  scene.addEventListener("pointerdown", (event) => (pressed = event.isTrusted ? event : pressed), capture);
  addEventListener(
    "pointerup",
    ({ isTrusted, clientX, clientY }) => {
      if (!isTrusted || pressed === null) return;
      const moved = Math.hypot(clientX - pressed.clientX, clientY - pressed.clientY);
      pressed = null;
      const { left, top } = canvas.getBoundingClientRect();
      if (moved < DRAG) clicked(clientX - left, clientY - top);
    },
    capture,
  );
}

/** Lets the viewer know of the pointer only while it drags or zooms. */
function onlyTheCamera(scene, canvas) {
  const move = (clientX, clientY) =>
    canvas.dispatchEvent(new MouseEvent("mousemove", { clientX, clientY, buttons: 1, bubbles: true }));
  const leave = () => canvas.dispatchEvent(new MouseEvent("mouseleave"));
  onlyDrags(scene, canvas, leave);
  onlySwipes(scene, move);
  let rest = 0;
  const zoom = () => {
    // The viewer zooms what the pointer is over; in this corner there is nothing to speak of.
    const { left, bottom } = canvas.getBoundingClientRect();
    move(left + 2, bottom - 2);
    clearTimeout(rest);
    rest = setTimeout(leave, WHEEL_RESTS_MS);
  };
  scene.addEventListener("wheel", zoom, { capture: true, passive: true });
}

/** A press of the mouse comes to the viewer when it has become a drag: clicks, which select, never do. */
function onlyDrags(scene, canvas, leave) {
  /** The press that is held back. */
  let pressed = null;
  let drags = false;
  const isMouse = ({ isTrusted, pointerType }) => isTrusted && pointerType !== "touch";
  const capture = { capture: true };
  scene.addEventListener(
    "pointerdown",
    (event) => {
      if (!isMouse(event)) return;
      if (!drags) pressed = event;
      event.stopPropagation();
    },
    capture,
  );
  addEventListener(
    "mousemove",
    (event) => {
      if (!event.isTrusted || drags) return;
      if (pressed !== null && Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) >= DRAG) {
        drags = true;
        canvas.dispatchEvent(new PointerEvent("pointerdown", pressed));
      } else if (pressed !== null || (event.buttons === 0 && scene.contains(event.target))) {
        event.stopPropagation();
      }
    },
    capture,
  );
  const end = (event) => {
    if (!isMouse(event)) return;
    if (pressed !== null && !drags) event.stopPropagation();
    // A drag of the panel's may end here too.
    else if (drags || scene.contains(event.target)) setTimeout(leave);
    [pressed, drags] = [null, false];
  };
  for (const name of ["pointerup", "pointercancel"]) addEventListener(name, end, capture);
}

/** A finger's press is a drag to the viewer from its beginning: it moves there and back within one of its frames. */
function onlySwipes(scene, move) {
  const noClick = ({ changedTouches: [{ clientX, clientY }] }) =>
    setTimeout(() => {
      move(clientX + 1.5 * DRAG, clientY);
      move(clientX, clientY);
    });
  scene.addEventListener("touchstart", noClick, { capture: true, passive: true });
}
