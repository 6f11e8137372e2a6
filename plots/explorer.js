// Draws what the reader picks of a setup's medians: a chart for each workload, a line for each cache (or, over the
// cost of a record or its rays, for each cache at one thread count).
"use strict";
(() => {
  const kMost = 12;        // charts at once
  const kShade = "#f1ece2";  // past the processing units
  Chart.defaults.font.family = getComputedStyle(document.body).fontFamily;
  Chart.defaults.color = "#333333";

  const shade = {
    id: "shade",
    beforeDatasetsDraw(chart, _, options) {
      const {left, right, top, bottom} = chart.chartArea;
      if (!options.from) return;
      const start = Math.max(left, chart.scales.x.getPixelForValue(options.from));
      if (start >= right) return;
      chart.ctx.fillStyle = kShade;
      chart.ctx.fillRect(start, top, right - start, bottom - top);
    },
  };
  // Intervals, and the markers of the figures.
  const marks = {
    id: "marks",
    beforeDatasetDraw(chart, {meta}) {
      const data = chart.data.datasets[meta.index], pen = chart.ctx;
      pen.save();
      pen.strokeStyle = data.borderColor;
      pen.lineWidth = 1.2;
      for (const [index, point] of meta.data.entries()) {
        const {low, high} = data.data[index];
        if (low === null) continue;
        pen.beginPath();
        pen.moveTo(point.x, chart.scales.y.getPixelForValue(low));
        pen.lineTo(point.x, chart.scales.y.getPixelForValue(high));
        pen.stroke();
      }
      pen.restore();
    },
    afterDatasetDraw(chart, {meta}) {
      const {marker, hollow, borderColor} = chart.data.datasets[meta.index], pen = chart.ctx;
      for (const point of meta.data) {
        pen.save();
        pen.translate(point.x, point.y);
        pen.strokeStyle = borderColor;
        pen.fillStyle = hollow ? "#ffffff" : borderColor;
        pen.fill(marker);
        pen.stroke(marker);
        pen.restore();
      }
    },
  };

  // Round values of a logarithmic axis, at most `most` of them: every step of some plan that fits.
  function roundValues(low, high, most) {
    const plans = [[1, 2, 3, 4, 5, 6, 8], [1, 2, 5], [1, 3], [1]];
    const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high));
    for (let stride = 1; ; stride += 1) {
      for (const steps of stride === 1 ? plans : [[1]]) {
        let found = [];
        for (let d = first; d <= last; ++d) if (d % stride === 0) found.push(...steps.map((s) => Number(`${s}e${d}`)));
        found = found.filter((v) => v >= low && v <= high);
        if (found.length <= most) return found.length ? found : [Math.sqrt(low * high)];
      }
    }
  }

  // From a little below the least interval to a little above the greatest; never zoomed into noise.
  function logarithmicRange(points) {
    const values = points.flatMap((p) => [p.y, p.low, p.high]).filter((v) => v !== null && v > 0);
    let low = Math.min(...values), high = Math.max(...values);
    if (high / low < 1.6) [low, high] = [Math.sqrt(low * high) / 1.6, Math.sqrt(low * high) * 1.6];
    return [low / 1.1, high * 1.1];
  }

  class Explorer {
    constructor(root) {
      this.root = root;
      this.data = icbench.parsed(root.dataset.from);
      this.form = root.querySelector("form");
      this.charts = [];
      this.index = new Map();
      const {p, c, t} = this.data.cells;
      for (let i = 0; i < p.length; ++i) this.index.set(this.key(p[i], c[i], t[i]), i);
      this.check("caches", this.data.first.caches);
      this.check("threads", this.data.threads);
      this.axisChanged(this.data.first.panels);
      this.form.addEventListener("submit", (event) => event.preventDefault());
      this.form.addEventListener("change", (event) => {
        if (event.target.name === "axis") this.axisChanged([0, 1]);
        this.draw();
      });
      this.form.addEventListener("click", (event) => this.allOrNone(event.target));
      root.querySelector("details").addEventListener("toggle", () => this.fillTable());
      root.hidden = false;
      this.draw();
    }

    key(panel, cache, threads) { return (panel * 1000 + cache) * 100000 + threads; }
    inputs(name) { return [...this.form.querySelectorAll(`input[name=${name}]`)]; }
    picked(name) { return this.inputs(name).filter((i) => i.checked).map((i) => Number(i.value)); }
    check(name, values) { for (const i of this.inputs(name)) i.checked = values.includes(Number(i.value)); }
    get axis() { return this.form.elements.axis.value; }
    get metric() { return this.data.metrics[Number(this.form.elements.metric.value)]; }

    // Over threads the workloads are those measured, and several thread counts make a line; over a parameter of
    // theirs they are what is left without it, and one thread count is picked.
    axisChanged(first) {
      const over = this.axis === "threads";
      const names = over ? this.data.panels : this.data.families[this.axis].map(([name]) => name);
      const boxes = this.form.querySelector(".workloads .boxes");
      boxes.replaceChildren(...names.map((name, i) => icbench.element("label", {},
        icbench.element("input", {type: "checkbox", name: "workloads", value: i}), name)));
      this.check("workloads", first);
      const counts = this.data.threads.filter((t) => !this.data.over || t < this.data.over);
      for (const i of this.inputs("threads")) i.type = over ? "checkbox" : "radio";
      this.check("threads", over ? this.data.threads : [(counts.length ? counts : this.data.threads).at(-1)]);
    }

    allOrNone(target) {
      const all = target.dataset.all, none = target.dataset.none;
      if (!all && !none) return;
      for (const i of target.closest("fieldset").querySelectorAll("input")) i.checked = Boolean(all);
      this.draw();
    }

    point(panel, cache, threads, x) {
      const cell = this.index.get(this.key(panel, cache, threads)), {m, l, h, n} = this.metric;
      if (cell === undefined || m[cell] === null || (this.metric.log && m[cell] <= 0)) return null;
      return {x, y: m[cell], low: l[cell], high: h[cell], n: n[cell]};
    }

    // The lines of one workload: [cache, points].
    lines(workload) {
      const threads = this.picked("threads");
      const line = (cache) => this.axis === "threads"
        ? threads.map((t) => this.point(workload, cache, t, t))
        : this.data.families[this.axis][workload][1].map(([x, panel]) => this.point(panel, cache, threads[0], x));
      return this.picked("caches").map((cache) => [cache, line(cache).filter(Boolean)]).filter((l) => l[1].length);
    }

    draw() {
      for (const chart of this.charts) chart.destroy();
      const names = this.axis === "threads" ? this.data.panels : this.data.families[this.axis].map(([name]) => name);
      const picked = this.picked("workloads"), workloads = picked.slice(0, kMost);
      const place = this.root.querySelector(".charts");
      place.replaceChildren();
      this.charts = workloads.map((workload) => this.chart(place, names[workload], this.lines(workload)));
      const empty = this.charts.every((chart) => !chart.data.datasets.length);
      this.say(empty ? "Nothing of what is picked was measured: pick a workload, a cache and a thread count."
        : picked.length > kMost ? `The first ${kMost} of ${picked.length} workloads are drawn.` : "");
      this.fillTable();
    }

    say(words) { this.root.querySelector(".said").textContent = words; }

    chart(place, title, lines) {
      const {words, unit, log} = this.metric, label = words + (unit ? `, ${unit}` : "");
      const canvas = icbench.element("canvas", {tabIndex: 0});
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `${label} of ${title}; arrow keys tell values`);
      place.append(icbench.element("figure", {}, icbench.element("figcaption", {}, title),
        icbench.element("div", {className: "canvas"}, canvas)));
      const xs = [...new Set(lines.flatMap(([, points]) => points.map((p) => p.x)))].sort((a, b) => a - b);
      const logarithmic = xs.length > 1 && xs[0] > 0;
      const room = logarithmic ? [xs[0] / 1.15, xs.at(-1) * 1.15]
        : [Math.min(...xs, 0) - 0.05 * (xs.at(-1) || 1), (xs.at(-1) || 1) * 1.05];
      const points = lines.flatMap(([, line]) => line);
      const [low, high] = log && points.length ? logarithmicRange(points) : [undefined, undefined];
      const chart = new Chart(canvas, {
        type: "line",
        data: {datasets: lines.map(([cache, points]) => this.dataset(this.data.caches[cache], points))},
        plugins: [shade, marks],
        options: {
          animation: false, responsive: true, maintainAspectRatio: false, parsing: false, normalized: true,
          interaction: {mode: "nearest", axis: "x", intersect: false},
          scales: {
            x: {
              type: logarithmic ? "logarithmic" : "linear", min: room[0], max: room[1],
              title: {display: true, text: this.axis === "threads" ? "threads" : this.data.axes[this.axis]},
              afterBuildTicks: (axis) => { axis.ticks = xs.map((value) => ({value})); },
              ticks: {callback: (value) => String(value), autoSkip: true, maxRotation: 0}, grid: {display: false},
            },
            y: {
              type: log ? "logarithmic" : "linear", beginAtZero: !log, min: low, max: high,
              afterBuildTicks: (axis) => { if (low) axis.ticks = roundValues(low, high, 7).map((value) => ({value})); },
              title: {display: true, text: label},
              ticks: {callback: (v) => v.toLocaleString("en-US", {maximumSignificantDigits: 3}), autoSkip: !log},
              grid: {color: "#e6e6e6"},
            },
          },
          plugins: {
            legend: {display: false},
            shade: {from: this.axis === "threads" ? this.data.over : null},
            tooltip: {
              itemSort: (a, b) => b.parsed.y - a.parsed.y,
              callbacks: {title: (items) => items.length ? this.at(items[0].raw.x) : "",
                          label: (item) => this.told(item)},
            },
          },
        },
      });
      canvas.addEventListener("keydown", (event) => this.go(event, chart, xs));
      canvas.addEventListener("blur", () => this.mark(chart, []));
      return chart;
    }

    dataset(look, points) {
      return {label: look.name, data: points, borderColor: look.colour, backgroundColor: look.colour,
              borderDash: look.dash, borderWidth: 1.6, marker: new Path2D(look.path), hollow: look.hollow,
              pointRadius: 0, pointHoverRadius: 8, pointHoverBackgroundColor: "transparent", pointHitRadius: 12};
    }

    at(x) {
      if (this.axis === "threads") return `${x} thread${x === 1 ? "" : "s"}`;
      return `${this.data.axes[this.axis]}: ${x}; threads: ${this.picked("threads")[0]}`;
    }

    told(item) {
      const {y, low, high, n} = item.raw, {unit} = this.metric;
      return `${item.dataset.label}: ${icbench.interval(y, low, high)}${unit ? ` ${unit}` : ""}, n = ${n}`;
    }

    // Arrow keys go from one x to the next and tell all that stands there, the best first.
    go(event, chart, xs) {
      const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
      if (event.key === "Escape") return this.mark(chart, []);
      if (!step || !xs.length) return;
      event.preventDefault();
      const now = chart.getActiveElements()[0];
      const at = now ? xs.indexOf(chart.data.datasets[now.datasetIndex].data[now.index].x) + step
        : step > 0 ? 0 : xs.length - 1;
      const x = xs[Math.max(0, Math.min(xs.length - 1, at))];
      const marked = chart.data.datasets.flatMap((set, datasetIndex) =>
        set.data.flatMap((point, index) => point.x === x ? [{datasetIndex, index}] : []));
      this.mark(chart, marked);
      const raw = marked.map((m) => ({dataset: chart.data.datasets[m.datasetIndex],
                                      raw: chart.data.datasets[m.datasetIndex].data[m.index]}));
      raw.sort((a, b) => (b.raw.y - a.raw.y) * (this.metric.more ? 1 : -1));
      this.say(`${this.at(x)}. ${raw.map((item) => this.told(item)).join("; ")}`);
    }

    mark(chart, elements) {
      const point = elements.length
        ? chart.getDatasetMeta(elements[0].datasetIndex).data[elements[0].index] : {x: 0, y: 0};
      chart.setActiveElements(elements);
      chart.tooltip.setActiveElements(elements, {x: point.x, y: point.y});
      chart.update();
      if (!elements.length) this.say("");
    }

    // The picked values as a table, made when it is open.
    fillTable() {
      const details = this.root.querySelector("details"), place = details.querySelector("div");
      place.replaceChildren();
      if (!details.open) return;
      const make = icbench.element;
      for (const chart of this.charts) {
        const xs = [...new Set(chart.data.datasets.flatMap((set) => set.data.map((p) => p.x)))].sort((a, b) => a - b);
        const title = chart.canvas.closest("figure").querySelector("figcaption").textContent;
        const head = make("tr", {}, make("th", {}, title), ...xs.map((x) => make("th", {className: "n"}, this.at(x))));
        const lines = chart.data.datasets.map((set) => make("tr", {}, make("td", {}, set.label), ...xs.map((x) => {
          const point = set.data.find((p) => p.x === x);
          return make("td", {className: "n"}, point ? icbench.interval(point.y, point.low, point.high) : "–");
        })));
        place.append(make("div", {className: "scroll"}, make("table", {}, make("thead", {}, head),
          make("tbody", {}, ...lines))));
      }
    }
  }

  for (const root of document.querySelectorAll(".explorer")) new Explorer(root);
  performance.mark("icbench-explorer");
})();
