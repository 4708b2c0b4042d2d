// Two ways to look at the scene of trimesh's viewer: from above without the roof, and with a headlamp along the main drift.
// The viewer's own names: camera, controls, scene, renderer, tracklight, render. DRIFT holds [x, y, z] every metre.
(function () {
  const DRIFT = $DRIFT;
  const lamp = new THREE.SpotLight(0xfff1dc, 2.6, 45, 0.85, 0.7, 1.4);
  const dim = new THREE.AmbientLight(0xffffff, 0.07);
  const point = k => new THREE.Vector3(...DRIFT[Math.max(0, Math.min(DRIFT.length - 1, k))]);
  let at = 0, yaw = 0, pitch = 0, inside = false, above = null, deviation = false, known = false;
  const KNOWN = [0xc0392b, 0xc98a12, 0x2f5d8a];  // assumed, interpolated, measured: the last letter of a mesh's name

  function look() {
    const k = Math.floor(at), place = point(k).lerp(point(k + 1), at - k);
    const ahead = point(k + 3).sub(point(k - 3));
    const heading = Math.atan2(-ahead.z, ahead.x) + yaw;
    const way = new THREE.Vector3(Math.cos(heading) * Math.cos(pitch), Math.sin(pitch), -Math.sin(heading) * Math.cos(pitch));
    camera.up.set(0, 1, 0);
    camera.position.copy(place);
    controls.target.copy(place).add(way);
    controls.update();
    lamp.position.copy(place).y += 0.2;
    lamp.target.position.copy(place).addScaledVector(way, 5);
    render();
  }

  // Meshes with "deviation" in their names are those of the others in other colours.
  function show() {
    scene.traverse(o => {
      if (o.isMesh) o.visible = o.name.includes("deviation") === deviation && (inside || !o.name.startsWith("roof"));
    });
    scene.traverse(o => {
      const how = o.isMesh && /_k([012])$/.exec(o.name);
      if (how) o.material.color.copy(known ? new THREE.Color(KNOWN[how[1]]).multiplyScalar(0.6) : o.userData.own);
    });
    document.getElementById("known").textContent = known ? "Elevation" : "What is measured";
    document.getElementById("legend").hidden = !known;
    document.getElementById("deviation").textContent = deviation ? "Rock" : "Deviation from the scan";
  }

  function choose(headlamp) {
    if (headlamp && !inside) above = [camera.position.clone(), camera.up.clone(), controls.target.clone(), camera.fov];
    inside = headlamp;
    show();
    tracklight.visible = controls.enabled = !inside;
    lamp.visible = dim.visible = inside;
    scene.background.set(inside ? 0x0b0a09 : 0xffffff);
    scene.fog = inside ? new THREE.Fog(0x0b0a09, 10, 70) : null;
    scene.traverse(o => { if (o.material) o.material.needsUpdate = true; });
    for (const [name, own] of [["above", false], ["headlamp", true]]) document.getElementById(name).disabled = own === inside;
    document.getElementById("how").textContent = inside ? "drag: look round; wheel, arrow keys: walk" : "drag: turn; wheel: zoom";
    camera.fov = inside ? 70 : above ? above[3] : camera.fov;
    camera.near = inside ? 0.1 : camera.near;
    if (!inside && above) {
      camera.position.copy(above[0]); camera.up.copy(above[1]); controls.target.copy(above[2]);
      controls.update();
    }
    camera.updateProjectionMatrix();
    if (inside) look(); else render();
  }

  function walk(metres) {
    at = Math.max(0, Math.min(DRIFT.length - 1.001, at + (Math.cos(yaw) < 0 ? -metres : metres)));
    look();
  }

  function start() {
    scene.add(lamp, lamp.target, dim);
    scene.traverse(o => { if (o.isMesh) { o.geometry.computeVertexNormals(); o.material.flatShading = false; } });
    let sorted = false;
    scene.traverse(o => {
      if (!o.isMesh || !/_k[012]$/.test(o.name)) return;
      o.material = o.material.clone();  // meshes of one colour share it
      o.userData.own = o.material.color.clone();
      sorted = true;
    });
    document.getElementById("known").hidden = !sorted;
    document.getElementById("known").onclick = () => { known = !known; show(); render(); };
    at = Math.min(12, DRIFT.length / 3);
    const view = renderer.domElement;
    let held = null;
    view.addEventListener("pointerdown", e => { held = [e.clientX, e.clientY]; });
    addEventListener("pointerup", () => { held = null; });
    addEventListener("pointermove", e => {
      if (!inside || !held) return;
      yaw += (e.clientX - held[0]) * 0.005;
      pitch = Math.max(-1.2, Math.min(1.2, pitch + (e.clientY - held[1]) * 0.005));
      held = [e.clientX, e.clientY];
      look();
    });
    view.addEventListener("wheel", e => { if (inside) { e.preventDefault(); walk(e.deltaY < 0 ? 1 : -1); } }, { passive: false });
    addEventListener("keydown", e => {
      const step = { ArrowUp: 1, ArrowDown: -1 }[e.key], turn = { ArrowLeft: 0.1, ArrowRight: -0.1 }[e.key];
      if (!inside || !(step || turn)) return;
      e.preventDefault();
      yaw += turn || 0;
      walk(step || 0);
    });
    document.getElementById("above").onclick = () => choose(false);
    document.getElementById("headlamp").onclick = () => choose(true);
    let scanned = false;
    scene.traverse(o => { scanned = scanned || o.name.includes("deviation"); });
    document.getElementById("deviation").hidden = !scanned;
    document.getElementById("deviation").onclick = () => { deviation = !deviation; show(); render(); };
    choose(false);
  }

  const waiting = setInterval(() => { if (controls) { clearInterval(waiting); start(); } }, 50);
})();
