// What the scene's canvas is spared: whatever of the viewer would take it apart.

/** The height of the viewer's bar of tabs, which the page cuts off, CSS pixels; as in page.css. */
export const CUT = 24;

/** Keeps what would change the arrangement away from the viewer on this element. @param {HTMLElement} scene */
export function atScene(scene) {
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
}
