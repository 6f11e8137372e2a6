// What the page's scripts share: numbers as the figures write them, and elements.
"use strict";
const icbench = {
  // Three significant digits without an exponent for what people meet; a dash for what is no number.
  number(value, digits = 3) {
    if (value === null || value === undefined || !isFinite(value)) return "–";
    if (value === 0) return "0";
    const magnitude = Math.floor(Math.log10(Math.abs(value)));
    if (magnitude < -3 || magnitude > 8) return value.toExponential(digits - 1);
    const places = Math.max(0, digits - 1 - magnitude);
    return value.toLocaleString("en-US", {minimumFractionDigits: places, maximumFractionDigits: places});
  },

  // "1.42 [1.38, 1.47]"; without brackets where there is no interval.
  interval(middle, low, high) {
    const known = low !== null && low !== undefined;
    return icbench.number(middle) + (known ? ` [${icbench.number(low)}, ${icbench.number(high)}]` : "");
  },

  // An element with properties, and children that are elements or text.
  element(tag, properties = {}, ...children) {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  },

  parsed(identity) {
    return JSON.parse(document.getElementById(identity).textContent);
  },
};
