// What the scene's canvas is spared: whatever of the viewer would take it apart, or speak of its inner workings.

/** The height of the viewer's bar of tabs, which the page cuts off, CSS pixels; as in page.css. */
export const CUT = 24;
/** A press that has moved so far is no click to the viewer, CSS pixels. */
const MORE_THAN_A_CLICK = 12;
/** So long after the wheel's last turn the viewer has zoomed, ms. */
const WHEEL_RESTS_MS = 400;

/**
 * Keeps from the viewer what would change the arrangement, select something or show texts at the pointer; what turns,
 * moves and zooms the camera is left.
 * @param {HTMLElement} scene
 * @param {HTMLCanvasElement} canvas the viewer's, in it
 */
export function atScene(scene, canvas) {
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
}

/** Lets the viewer know of the pointer only while it drags or zooms. */
function onlyTheCamera(scene, canvas) {
  const move = (clientX, clientY) =>
    canvas.dispatchEvent(new MouseEvent("mousemove", { clientX, clientY, buttons: 1, bubbles: true }));
  const leave = () => canvas.dispatchEvent(new MouseEvent("mouseleave"));
  // There and back within one of the viewer's frames: the camera stays, and the press is a drag from its beginning.
  const noClick = ({ clientX, clientY }) =>
    setTimeout(() => {
      move(clientX + MORE_THAN_A_CLICK, clientY);
      move(clientX, clientY);
    });
  const capture = { capture: true };
  const hover = (event) => event.isTrusted && event.buttons === 0 && event.stopPropagation();
  scene.addEventListener("mousemove", hover, capture);
  scene.addEventListener("pointerdown", (event) => event.pointerType === "mouse" && noClick(event), capture);
  scene.addEventListener("touchstart", (event) => noClick(event.changedTouches[0]), { capture: true, passive: true });
  addEventListener("pointerup", () => setTimeout(leave));
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
