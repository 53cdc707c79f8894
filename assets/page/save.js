// Files for the visitor to take away.

/** How long a browser may take to begin with a file, ms. */
const KEPT_MS = 10_000;

/** Offers the file at an address. @param {string} address @param {string} name */
export function save(address, name) {
  Object.assign(document.createElement("a"), { href: address, download: name }).click();
}

/** Offers a file that is made here. @param {Blob} blob @param {string} name */
export function saveBlob(blob, name) {
  const address = URL.createObjectURL(blob);
  save(address, name);
  setTimeout(() => URL.revokeObjectURL(address), KEPT_MS);
}
