// Answers the three questions of the first page from answers that were worked out beforehand, for round numbers of rays
// (or microseconds) a record and for every number of cores that there is evidence for.
"use strict";
(() => {
  const make = icbench.element, {number, interval} = icbench;
  const percent = (middle, low, high) => {
    const round = (v) => (Math.abs(v) < 0.1 ? Number((v * 100).toFixed(1)) : Math.round(v * 100)) + 0;
    return `${round(middle).toLocaleString("en-US")} %` + (low === null ? "" : ` [${round(low)}, ${round(high)}]`);
  };
  const listed = (words) => words.length < 2 ? words.join("") : `${words.slice(0, -1).join(", ")} and ${words.at(-1)}`;
  const capital = (words) => words[0].toUpperCase() + words.slice(1);
  const cores = (n) => `${n} core${n === 1 ? "" : "s"}`;

  class Choice {
    constructor(root) {
      this.data = icbench.parsed(root.dataset.from);
      this.form = root.querySelector("form");
      this.place = root.querySelector(".answer");
      this.form.addEventListener("submit", (event) => event.preventDefault());
      this.form.addEventListener("input", () => this.show());
      this.show();
    }

    value(name) {
      const input = this.form.elements[name];
      return !input || input.value === "" ? null : Number(input.value);
    }

    // The nearest number of rays or microseconds that answers were worked out for, by ratio.
    nearest(x) {
      const distance = (v) => Math.abs(Math.log((v + 1e-3) / (x + 1e-3)));
      return this.data.x.reduce((best, v, i) => distance(v) < distance(this.data.x[best]) ? i : best, 0);
    }

    show() {
      const x = this.value("x"), asked = this.value("cores"), error = this.value("error");
      if (x === null || !(x >= 0) || !(asked >= 1)) {
        this.place.replaceChildren(make("p", {}, `Say ${this.data.inRays ? "how many rays a record takes" : "what a record costs"}, and how many cores there are.`));
        return;
      }
      const at = this.nearest(x), {threads} = this.data;
      const below = threads.filter((n) => n <= asked).at(-1), above = threads.find((n) => n >= asked);
      const shown = [...new Set([below, above])].filter((n) => n !== undefined);
      const made = [this.setting(at, error)];
      if (this.data.x[at] !== x) made.push(this.note(`Answered for ${this.amount(at)}, the nearest worked out.`));
      if (above === undefined)
        made.push(make("p", {className: "beyond"},
          `Nothing is known for ${cores(asked)}: the most that there is evidence for is ${threads.at(-1)}, which ` +
          "follows. It is no answer for more."));
      else if (below === undefined)
        made.push(this.note(`There is no evidence for ${cores(asked)}: the fewest that there is any for are ` +
          `${threads[0]}, which follow.`));
      else if (shown.length === 2)
        made.push(this.note(`There is evidence for ${shown.join(" and ")} cores, none for ${asked}: both follow.`));
      const accuracy = this.accuracy(at, error);
      for (const n of shown) made.push(...this.answer(at, n, accuracy, error));
      this.place.replaceChildren(...made);
    }

    note(words) { return make("p", {className: "note"}, words); }

    amount(at) {
      const {x, microseconds, inRays} = this.data;
      if (!inRays) return `${number(x[at])} µs a record`;
      return `${x[at]} rays a record` + (microseconds[at] === null ? "" : ` (about ${number(microseconds[at])} µs)`);
    }

    // The coarsest accuracy whose whole interval of errors is tolerable; the finest where there is none.
    accuracy(at, error) {
      const known = this.data.errors[at];
      if (!known.length) return this.data.accuracies[0];
      const enough = known.find(([, middle, , high]) => error === null || (high ?? middle) <= error);
      return (enough ?? known.at(-1))[0];
    }

    // What the tolerable error asks for.
    setting(at, error) {
      const known = this.data.errors[at];
      if (!known.length) return this.note("No errors were measured with these results, so none is asked for.");
      const [accuracy, middle, low, high, measured] = known.find(([a]) => a === this.accuracy(at, error));
      const from = measured ? "measured" : "from the nearest numbers of rays";
      const value = `relMSE ${interval(middle, low, high)}, ${from}` + ` in ${this.data.scene}`;
      const kept = error === null || (high ?? middle) <= error;
      const words = kept ? `Accuracy a = ${accuracy}: ${value}.`
        : `No accuracy measured keeps relMSE within ${error} at this many rays: the finest, a = ${accuracy}, ` +
          `has ${value}. ` + "Take more rays.";
      return make("p", {className: kept ? "setting" : "beyond"}, words);
    }

    found(at, n, accuracy) {
      const {answers} = this.data;
      return answers[`${at} ${n} ${accuracy}`] ?? answers[`${at} ${n}`];
    }

    answer(at, n, accuracy, error) {
      const found = this.found(at, n, accuracy), {kinds, caches, ways, sures} = this.data;
      if (!found) return [this.note(`Nothing was measured for ${this.amount(at)} on ${cores(n)}.`)];
      const [certainty, certain, way, repetitions, rendered, lines] = found;
      const best = lines[0], rest = lines.slice(1);
      const trifle = this.data.negligible[certainty];
      const least = (line) => certainty === this.data.simulated ? line[3] ?? line[2] : line[3];
      const told = (line) => least(line) !== null && least(line) > trifle;
      const tied = rest.filter((l) => !told(l)), behind = rest.filter(told);
      const said = [`With ${this.amount(at)} on ${cores(n)}, use `, make("b", {}, kinds[best[0]]), " (",
        make("code", {}, caches[best[1]]), "). "];
      if (best[5] !== null) {
        said.push(best[5] > 0 ? `Sharing costs ${percent(best[5], best[6], best[7])} of the cores' time. `
          : `Sharing costs nothing that shows (${percent(best[5], best[6], best[7])} of the cores' time). `);
      }
      if (tied.length) {
        const names = listed(tied.map((l) => kinds[l[0]]));
        said.push(`Not shown to be more than ${percent(trifle - 1, null)} slower: ${names}. `);
      }
      said.push(...this.tieBreak(n, [best, ...tied]));
      if (behind.length) {
        const next = behind[0], last = behind.at(-1);
        said.push(`${capital(kinds[next[0]])} would take ${interval(next[2], next[3], next[4])} times as long`);
        said.push(last === next ? ". " : `, ${kinds[last[0]]} ${interval(last[2], last[3], last[4])} times. `);
      }
      const sure = [make("b", {className: `sure sure-${certainty}`}, sures[certain]), `: ${ways[way]}`];
      if (repetitions) sure.push(`; ${repetitions} repetition${repetitions === 1 ? "" : "s"}`);
      if (repetitions && repetitions < 3) sure.push(", so no interval");
      else if (repetitions && repetitions < this.data.few) sure.push(", so few that intervals cover less than 95 %");
      const made = [make("p", {className: "use"}, ...said), make("p", {className: "how"}, "How sure: ", ...sure, ".")];
      if (rendered) made.push(...this.rival(n, error, best));
      made.push(this.table(lines, rendered, n));
      return made;
    }

    // Of mechanisms that cannot be told apart, the one whose queries are held up least by threads that were put to
    // sleep.
    tieBreak(n, equal) {
      const {tails, tailThreads, kinds, cores: all} = this.data;
      const known = equal.filter((l) => tails[l[1]] !== null);
      if (n === 1 || known.length < 2 || known.length < equal.length) return [];
      const calm = known.reduce((a, b) => tails[b[1]] < tails[a[1]] ? b : a);
      const worst = known.reduce((a, b) => tails[b[1]] > tails[a[1]] ? b : a);
      return [`Of these, ${kinds[calm[0]]} has the calmest queries when threads are put to sleep: with ${tailThreads} ` +
        `threads on ${cores(all)}, one in a thousand takes ${number(tails[calm[1]] * 1e-3)} µs or more; with ` +
        `${kinds[worst[0]]}, ${number(tails[worst[1]] * 1e-3)} µs. `];
    }

    // What path tracing needs for the tolerable error, between the numbers of samples measured.
    rival(n, error, best) {
      const known = this.data.path[n];
      if (!known || error === null) return [];
      for (let i = 1; i < known.length; ++i) {
        const [worse, less] = known[i - 1], [better, more] = known[i];
        if (!(better <= error && error <= worse) || better === worse) continue;
        const share = Math.log(worse / error) / Math.log(worse / better);
        const seconds = less * (more / less) ** share;
        return [this.note(`Path tracing needs ${number(seconds)} s for relMSE ${error} on ${cores(n)} ` +
          `(between ${number(less)} and ${number(more)} s measured); this takes ${number(best[9])} s.`)];
      }
      return [];
    }

    table(lines, rendered, n) {
      const {kinds, caches, structures} = this.data;
      const heads = ["access mechanism", "fastest cache", "structure", "time, × the fastest",
        "cores' time lost to sharing", "records beyond one thread's",
        rendered ? "seconds of the picture's indirect light" : "queries answered, M/s"];
      const head = make("tr", {}, ...heads.map((h, i) => make("th", {className: i > 2 ? "n" : ""}, h)));
      const body = lines.map((l) => make("tr", {}, make("td", {}, kinds[l[0]]), make("td", {}, caches[l[1]]),
        make("td", {}, structures[l[1]]), make("td", {className: "n"}, interval(l[2], l[3], l[4])),
        make("td", {className: "n"}, l[5] === null ? "–" : percent(l[5], l[6], l[7])),
        make("td", {className: "n"}, l[8] === null ? "–" : percent(l[8], null)),
        make("td", {className: "n"}, number(rendered ? l[9] : 1e-6 / l[9]))));
      return make("div", {className: "scroll"}, make("table", {}, make("caption", {}, cores(n)),
        make("thead", {}, head), make("tbody", {}, ...body)));
    }
  }

  for (const root of document.querySelectorAll(".choice")) new Choice(root);
  // The form answers on the screen, the table on paper.
  const tables = document.querySelectorAll("details.plain");
  for (const table of tables) table.open = false;
  addEventListener("beforeprint", () => { for (const table of tables) table.open = true; });
  addEventListener("afterprint", () => { for (const table of tables) table.open = false; });
  performance.mark("icbench-choice");
})();
