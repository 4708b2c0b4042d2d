// Maps and sections of the report: they are moved, enlarged and coloured; names stay readable, as many as have room.
// A chart's data is JSON: quads [x, y four times, walls, roof, floor], lines, paths, stations [name, x, y, about, order], places
// [number, x, y, text], picture, grid {at, per_m, names}, modes, prefix, stretch. x is to the right, y is up, m.
(function () {
  const NS = "http://www.w3.org/2000/svg", KNOWN = ["assumed", "interpolated", "measured"];
  const LABEL_PX = 12, WIDEST = 40, GRID_PX = 110;

  function element(kind, parent, values) {
    const made = document.createElementNS(NS, kind);
    for (const [key, value] of Object.entries(values || {})) made.setAttribute(key, value);
    parent.appendChild(made);
    return made;
  }

  function Chart(box) {
    const data = JSON.parse(box.querySelector("script").textContent), svg = box.querySelector("svg");
    const [west, south, east, north] = data.bounds, stretch = data.stretch || 1;
    const world = element("g", svg), grid = element("g", svg, { class: "grid" }), marks = element("g", svg);
    const about = box.querySelector(".about"), prefix = data.prefix || "";
    let scale = 1, x = 0, y = 0, chosen = null, fit = 1, mode = data.modes[0][0];

    // Where a place is on the screen, px.
    const px = place => [(place[0] - x) * scale, (y - place[1]) * scale * stretch];
    const wide = () => svg.clientWidth, high = () => svg.clientHeight;

    function whole() {
      fit = Math.min(wide() / ((east - west) * 1.08 || 1), high() / ((north - south) * 1.12 * stretch || 1));
      scale = fit;
      x = (west + east) / 2 - wide() / scale / 2;
      y = (south + north) / 2 + high() / scale / stretch / 2;
      draw();
    }

    function zoom(factor, at) {
      const [u, v] = at || [wide() / 2, high() / 2];
      const next = Math.max(fit * 0.8, Math.min(fit * 400, scale * factor));
      x += u / scale - u / next;
      y -= (v / scale - v / next) / stretch;
      scale = next;
      draw();
    }

    function look(place, metres) {
      scale = Math.max(fit, Math.min(wide(), high()) / metres);
      x = place[0] - wide() / scale / 2;
      y = place[1] + high() / scale / stretch / 2;
      draw();
    }

    function colour() {
      const column = ["walls", "roof", "floor"].indexOf(mode);
      shapes.forEach(([shape, quad]) => {
        shape.setAttribute("class", column < 0 ? "plain" : KNOWN[quad[8 + column]]);
      });
      if (picture) picture.style.display = column < 0 ? "" : "none";
      box.dataset.mode = mode;
      box.querySelectorAll("button[data-mode]").forEach(b => b.setAttribute("aria-pressed", b.dataset.mode === mode));
    }

    // Round steps of the mine's own grid, with its numbers at the edges; it has `per_m` units to a metre.
    function drawGrid() {
      grid.replaceChildren();
      const per = data.grid.per_m;
      [[0, x, wide(), scale], [1, y - high() / scale / stretch, high(), scale * stretch]].forEach(([axis, from, length, size]) => {
        const least = Math.min(axis ? GRID_PX / 2 : GRID_PX, length / 5) / size * per, base = 10 ** Math.floor(Math.log10(least));
        const step = base * [1, 2, 5, 10].find(k => k * base >= least * 0.999);
        const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), at = data.grid.at[axis];
        const last = (from + length / size) * per + at;
        for (let k = Math.ceil((from * per + at) / step); k * step <= last; k++) {
          const metres = (k * step - at) / per, place = axis ? px([0, metres])[1] : px([metres, 0])[0];
          element("line", grid, axis ? { x1: 0, x2: wide(), y1: place, y2: place } : { x1: place, x2: place, y1: 0, y2: high() });
          const words = axis ? { x: 3, y: place - 3 } : { x: place + 3, y: high() - 4 };
          const text = (k * step + 0).toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
          if (axis ? place > 14 && place < high() - 18 : place < wide() - 34) element("text", grid, words).textContent = text;
        }
      });
    }

    function drawMarks() {
      marks.replaceChildren();
      const taken = [], inside = ([u, v]) => u > -20 && v > -20 && u < wide() + 20 && v < high() + 20;
      const free = b => taken.every(t => b[0] > t[2] || b[2] < t[0] || b[1] > t[3] || b[3] < t[1]);
      if (data.start) {
        const [u, v] = px(data.start);
        element("path", marks, { class: "start", d: star(u, v, 9) });
        taken.push([u - 9, v - 9, u + 9, v + 9]);
      }
      data.places.forEach(([number, px_, py_, text]) => {
        const [u, v] = px([px_, py_]);
        if (!inside([u, v])) return;
        const mark = element("g", marks, { class: "place" });
        element("circle", mark, { cx: u, cy: v, r: 9 });
        element("text", mark, { x: u, y: v + 4, "text-anchor": "middle" }).textContent = number;
        mark.addEventListener("click", () => { about.textContent = `${number}: ${text}`; });
        taken.push([u - 10, v - 10, u + 10, v + 10]);
      });
      const shown = data.stations.map(s => [s, px([s[1], s[2]])]).filter(([, at]) => inside(at));
      const order = [...shown].sort((a, b) => (b[0] === chosen) - (a[0] === chosen) || b[0][4] - a[0][4]);
      shown.forEach(([station, [u, v]]) => {
        const [kind, r] = station === chosen ? ["chosen", 6] : ["dot", Math.min(4, 1.5 + scale / 8)];
        const dot = element("circle", marks, { class: kind, cx: u, cy: v, r });
        dot.addEventListener("click", () => choose(station));
      });
      for (const [station, [u, v]] of order) {
        const name = station[0].startsWith(prefix) ? station[0].slice(prefix.length) : station[0];
        const short = name.length > WIDEST ? name.slice(0, WIDEST - 1) + "…" : name, length = short.length * LABEL_PX * 0.6;
        for (const [dx, dy] of [[6, -5], [6, 13], [-6 - length, -5], [-6 - length, 13]]) {
          const b = [u + dx - 1, v + dy - LABEL_PX, u + dx + length, v + dy + 2];
          if (b[0] < 0 || b[2] > wide() || b[1] < 0 || b[3] > high() - 14 || !free(b)) continue;
          taken.push(b);
          const label = element("text", marks, { class: station === chosen ? "name chosen" : "name", x: u + dx, y: v + dy });
          label.textContent = short;
          label.addEventListener("click", () => choose(station));
          break;
        }
      }
      if (shown.length) svg.dataset.named = taken.length;
    }

    function star(u, v, r) {
      const points = [...Array(10).keys()].map(k => {
        const far = k % 2 ? r * 0.4 : r, turn = Math.PI * (k / 5 - 0.5);
        return `${u + far * Math.cos(turn)},${v + far * Math.sin(turn)}`;
      });
      return `M${points.join("L")}Z`;
    }

    function choose(station) {
      chosen = station;
      about.textContent = `${station[0]}: ${station[3]}`;
      drawMarks();
    }

    function draw() {
      world.setAttribute("transform", `matrix(${scale} 0 0 ${-scale * stretch} ${-x * scale} ${y * scale * stretch})`);
      svg.style.touchAction = scale > fit * 1.01 ? "none" : "pan-y";
      drawGrid();
      drawMarks();
    }

    // The link of a station or of a place elsewhere on the page shows it here.
    this.find = name => {
      const station = data.stations.find(s => s[0] === name) || data.stations.find(s => s[0].endsWith(name));
      if (!station) { about.textContent = `${name}: no station has this name`; return; }
      look([station[1], station[2]], 30);
      choose(station);
    };
    this.show = (place, text) => { look(place, 30); about.textContent = text; };

    const picture = data.picture ? element("image", world, {
      href: data.picture.url, x: data.picture.west, y: -data.picture.north, width: data.picture.wide, height: data.picture.high,
      transform: "scale(1 -1)", preserveAspectRatio: "none", style: "image-rendering: pixelated",
    }) : null;
    data.paths.forEach(values => element("path", world, values));
    const shapes = data.quads.map(q => [element("path", world, { d: `M${q[0]} ${q[1]}L${q[2]} ${q[3]} ${q[4]} ${q[5]} ${q[6]} ${q[7]}Z` }), q]);
    const lines = data.lines.map(l => `M${l.join(" ")}`).join("");
    if (lines) element("path", world, { class: "leg", d: lines });

    const held = new Map();
    svg.addEventListener("pointerdown", e => held.set(e.pointerId, [e.clientX, e.clientY]));
    addEventListener("pointerup", e => held.delete(e.pointerId));
    addEventListener("pointercancel", e => held.delete(e.pointerId));
    svg.addEventListener("pointermove", e => {
      const before = held.get(e.pointerId);
      if (!before) return;
      const others = [...held].filter(([id]) => id !== e.pointerId).map(([, at]) => at), now = [e.clientX, e.clientY];
      held.set(e.pointerId, now);
      if (others.length) {
        const apart = p => Math.hypot(p[0] - others[0][0], p[1] - others[0][1]), frame = svg.getBoundingClientRect();
        zoom(apart(now) / Math.max(apart(before), 1), [(now[0] + others[0][0]) / 2 - frame.left, (now[1] + others[0][1]) / 2 - frame.top]);
      } else if (scale > fit * 1.01 || e.pointerType === "mouse") {
        x -= (now[0] - before[0]) / scale;
        y += (now[1] - before[1]) / scale / stretch;
        draw();
      }
    });
    svg.addEventListener("wheel", e => {
      if (!e.ctrlKey && !e.metaKey) return;
      e.preventDefault();
      zoom(e.deltaY < 0 ? 1.25 : 0.8, [e.offsetX, e.offsetY]);
    }, { passive: false });
    svg.addEventListener("dblclick", e => zoom(2, [e.offsetX, e.offsetY]));
    box.querySelectorAll("button[data-mode]").forEach(b => b.addEventListener("click", () => { mode = b.dataset.mode; colour(); }));
    box.querySelector("[data-do=in]").addEventListener("click", () => zoom(2));
    box.querySelector("[data-do=out]").addEventListener("click", () => zoom(0.5));
    box.querySelector("[data-do=whole]").addEventListener("click", whole);
    const search = box.querySelector("input");
    if (search) search.addEventListener("change", () => search.value && this.find(search.value));
    new ResizeObserver(whole).observe(svg);
    colour();
    whole();
  }

  const charts = Object.fromEntries([...document.querySelectorAll(".chart")].map(box => [box.id, new Chart(box)]));
  document.addEventListener("click", e => {
    const link = e.target.closest("a[data-station], a[data-at]");
    if (!link || !charts.map) return;
    e.preventDefault();
    document.getElementById("map").scrollIntoView({ behavior: "instant", block: "start" });
    if (link.dataset.station) charts.map.find(link.dataset.station);
    else charts.map.show(link.dataset.at.split(",").map(Number), link.dataset.text);
  });
})();
