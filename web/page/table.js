// The table of learners: the latest errors, and what has become of each.

/** Movements within the thresholds that must follow before a run counts as converged. */
const CONFIRMATION = 20;
const DASH = "–";

/** Follows the learners' reports and shows them. */
export class Table {
  #body;
  #colours;
  #description = null;
  /** Per learner, the last step outside the thresholds. */
  #lastOutside = [];

  /**
   * @param {HTMLElement} body
   * @param {string[]} colours
   */
  constructor(body, colours) {
    this.#body = body;
    this.#colours = colours;
  }

  /** Begins a run. @param {object} description */
  begin(description) {
    this.#description = description;
    this.#lastOutside = description.learners.map(() => -1);
    this.#body.replaceChildren(
      ...description.learners.map((learner, index) => {
        const row = document.createElement("tr");
        const name = document.createElement("th");
        name.scope = "row";
        const swatch = document.createElement("span");
        swatch.className = "swatch";
        swatch.style.background = this.#colours[index % this.#colours.length];
        const kind = document.createElement("small");
        kind.textContent = ` ${learner.estimator} × ${learner.policy}`;
        name.append(swatch, learner.name, kind);
        row.append(name, ...["number", "number", "number", "number", ""].map(cell));
        return row;
      }),
    );
  }

  /** Takes a report in. @param {object} report */
  take(report) {
    const { thresholds, truth } = this.#description;
    report.learners.forEach(({ metrics }, index) => {
      const within =
        (metrics.orientation_deg ?? 0) <= thresholds.orientation_deg && (metrics.location_m ?? 0) <= thresholds.location_m;
      if (truth !== null && !within) this.#lastOutside[index] = report.step;
    });
  }

  /** Shows a report that was taken in. @param {object} report */
  show(report) {
    report.learners.forEach((learner, index) => {
      const { metrics } = learner;
      const [movements, orientation, location, prediction, state] = this.#body.rows[index].querySelectorAll("td");
      movements.textContent = String(metrics.movements) + (metrics.misses ? ` (${metrics.misses} missed)` : "");
      orientation.textContent = fixed(metrics.orientation_deg, 1, 2);
      location.textContent = fixed(metrics.location_m, 1000, 1);
      prediction.textContent = fixed(metrics.prediction_mean_m, 1000, 1);
      [state.textContent, state.className] = this.#state(learner, index, report.step);
      state.title = learner.failure ?? "";
    });
  }

  /** @returns {[string, string]} words and class */
  #state(learner, index, step) {
    if (learner.failure) return ["diverged: stopped learning", "bad"];
    if (this.#description.truth === null) {
      return learner.metrics.settled ? ["settled, by its own estimate", "good"] : ["learning", ""];
    }
    const first = this.#lastOutside[index] + 1;
    if (first > step) return ["not converged yet", ""];
    const confirmed = step - first;
    if (confirmed >= CONFIRMATION) return [`converged at movement ${first}`, "good"];
    return [`within since ${first}; ${confirmed} of ${CONFIRMATION} confirm`, ""];
  }
}

/** @param {string} className */
function cell(className) {
  const cell = document.createElement("td");
  cell.className = className;
  cell.textContent = DASH;
  return cell;
}

/** @param {number | null} value @param {number} scale @param {number} digits */
function fixed(value, scale, digits) {
  return value === null ? DASH : (value * scale).toFixed(digits);
}
