// Answers "what do I use if I have x seconds", scene by scene, and shows the table of the error that is picked.
"use strict";
(() => {
  const make = icbench.element, {number, interval} = icbench;
  // Places in a point of the data, and in its value by one error.
  const kMethod = 0, kSetting = 1, kSeconds = 2, kLow = 3, kHigh = 4, kValues = 5;

  class Seconds {
    constructor(root) {
      this.data = icbench.parsed(root.dataset.from);
      this.root = root;
      this.form = root.querySelector("form");
      this.place = root.querySelector(".answer");
      this.form.addEventListener("submit", (event) => event.preventDefault());
      this.form.addEventListener("input", () => this.show());
      this.form.hidden = false;
      this.show();
    }

    show() {
      const metric = Number(this.form.elements.metric.value), {error} = this.data.metrics[metric];
      for (const one of this.root.querySelectorAll(".by")) one.classList.toggle("off", one.dataset.error !== error);
      const typed = this.form.elements.seconds.value, seconds = Number(typed);
      if (typed === "" || !(seconds > 0)) {
        this.place.replaceChildren(make("p", {}, "Say how many seconds there are, more than 0."));
        return;
      }
      const answers = this.data.scenes.map((scene) => [scene, this.answer(scene, seconds, metric)]);
      this.place.replaceChildren(this.summary(answers, seconds), this.table(answers, metric, seconds));
    }

    // Of every method the point of least error, the fastest of several, within the time; the best first.
    answer(scene, seconds, metric) {
      const best = new Map(), value = (p) => p[kValues][metric];
      const before = (a, b) => value(a)[0] - value(b)[0] || a[kSeconds] - b[kSeconds];
      for (const point of scene.points) {
        if (point[kSeconds] > seconds || value(point)[0] === null) continue;
        const known = best.get(point[kMethod]);
        if (!known || before(point, known) < 0) best.set(point[kMethod], point);
      }
      const [first, ...others] = [...best.values()].sort(before);
      if (!first) return null;
      const to = value(first)[2];
      return {best: first, tied: to === null ? [] : others.filter((p) => value(p)[1] !== null && value(p)[1] <= to)};
    }

    // What is best in how many scenes.
    summary(answers, seconds) {
      const counts = new Map(), known = answers.filter(([, found]) => found);
      const scenes = this.data.scenes.length, said = [`With ${seconds} s, `];
      if (!known.length) return make("p", {className: "beyond"}, `${said[0]}nothing that was measured is fast enough.`);
      for (const [, found] of known) counts.set(found.best[kMethod], (counts.get(found.best[kMethod]) ?? 0) + 1);
      const ranked = [...counts].sort((a, b) => b[1] - a[1]);
      said.push("use ");
      for (const [i, [method, count]] of ranked.entries()) {
        if (i) said.push(i + 1 === ranked.length ? " and " : ", ");
        said.push(make("b", {}, this.data.methods[method]));
        if (scenes > 1) said.push(` in ${count === scenes ? "all" : count}${i || count === scenes ? "" : " of"}`,
          i ? "" : ` ${scenes} scenes`);
      }
      return make("p", {className: "use"}, ...said, ".");
    }

    table(answers, metric, seconds) {
      const {words, unit} = this.data.metrics[metric], {methods} = this.data;
      const name = (point) => [make("b", {}, methods[point[kMethod]]),
        make("span", {className: "under wrap"}, point[kSetting])];
      const heads = ["scene", "use", words + (unit ? `, ${unit}` : ""), "takes, s", "as good, as far as the runs tell"];
      const head = make("tr", {}, ...heads.map((h, i) => make("th", {className: i === 2 || i === 3 ? "n" : ""}, h)));
      const body = answers.map(([scene, found]) => {
        const key = make("td", {className: "key"}, scene.name);
        if (!found) {
          const first = scene.points.reduce((a, b) => b[kSeconds] < a[kSeconds] ? b : a);
          return make("tr", {}, key, make("td", {colSpan: 4, className: "open"},
            `nothing is that fast: ${methods[first[kMethod]]} (${first[kSetting]}) takes ` +
            `${number(first[kSeconds])} s`));
        }
        const {best, tied} = found, [value, from, to, own] = best[kValues][metric];
        const late = best[kHigh] !== null && best[kHigh] > seconds;
        const also = tied.map((p) => `${methods[p[kMethod]]} (${p[kSetting]})`).join(", ");
        return make("tr", {}, key, make("td", {}, ...name(best)),
          make("td", {className: "n"}, interval(value, from, to) + (own ? " *" : "")),
          make("td", {className: late ? "n open" : "n"}, interval(best[kSeconds], best[kLow], best[kHigh]),
            ...(late ? [make("span", {className: "under"}, "may take longer")] : [])),
          make("td", {}, also || (to === null ? "not known: one run" : "none")));
      });
      const notes = [];
      const all = answers.filter(([scene]) => scene.slowest < seconds).length;
      if (all) {
        notes.push(make("p", {className: "note"}, `Nothing that was measured ${all === answers.length ? "" :
          `in ${all} of the scenes `}takes that long: what is best of all is named there.`));
      }
      return make("div", {}, make("div", {className: "scroll"}, make("table", {}, make("thead", {}, head),
        make("tbody", {}, ...body))), ...notes);
    }
  }

  for (const root of document.querySelectorAll(".budget")) new Seconds(root);
})();
