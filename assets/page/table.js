// Tables of what is in files.

/** So many rows are shown of those that a doubt names. */
const MOST_ROWS = 5;

/** A table of cells, its head first. @param {(string | number)[][]} lines @param {number} [marked] a column to look at */
export function cells([head, ...lines], marked = -1) {
  const row = (cells, kind) => {
    const row = document.createElement("tr");
    row.append(...cells.map((text, column) => {
      const cell = Object.assign(document.createElement(kind), { textContent: text });
      if (column === marked) cell.className = "doubted";
      return cell;
    }));
    return row;
  };
  const table = document.createElement("table");
  table.createTHead().append(row(head, "th"));
  table.createTBody().append(...lines.map((line) => row(line, "td")));
  const box = Object.assign(document.createElement("div"), { className: "rows" });
  box.append(table);
  return box;
}

/**
 * Some lines of a CSV file, as it has them.
 * @param {string} text
 * @param {number[]} numbers of lines, the first is 1
 * @param {string | null} column the title of the column that is doubted
 */
export function rows(text, numbers, column) {
  const all = text.split(/\r\n|\n|\r/);
  const head = all.findIndex((line) => line.trim() !== "" && !line.startsWith("#"));
  const separator = [",", ";", "\t"].find((mark) => all[head].includes(mark)) ?? ",";
  const split = (line = "") => line.split(separator);
  const titles = split(all[head]);
  const lines = numbers.slice(0, MOST_ROWS).map((number) => [number, ...split(all[number - 1])]);
  const more = numbers.length - lines.length;
  if (more > 0) lines.push([`and ${more} more`]);
  return cells([["line", ...titles], ...lines], titles.indexOf(column) + 1 || -1);
}
