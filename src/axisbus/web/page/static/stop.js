// Repeats a quick stop by separate requests until the server has confirmed it; shows a message if the server has not.
"use strict";
(() => {
  const WAIT = 400, SOON = 800, AGAIN = 500, PATIENCE = 2000, LONGEST = 15_000; // ms
  const NOT_YET = "The quick stop has not reached the machine: use the emergency stop. Sending it again.";
  const NOT = "The quick stop did not reach the machine: use the emergency stop.";
  let wanted = null, trying = false; // time of the unconfirmed quick stop, and its socket

  function words(text) {
    const node = document.querySelector("#unstopped");
    if (node && node.textContent !== text) node.textContent = text;
    document.body.classList.toggle("unstopped", text !== "");
  }
  function done() {
    wanted = null;
    words("");
  }
  // A stop was asked for; ``socket`` is the one that it went by, null where it could go by none.
  function begin(socket) {
    wanted = { at: performance.now(), socket };
    if (!trying) setTimeout(attempt, socket ? WAIT : 0);
    setTimeout(() => wanted && words(NOT_YET), SOON);
  }
  // The server has received all that this socket has sent until then.
  function heard(socket, until) {
    if (wanted && wanted.socket === socket && until >= wanted.at) done();
  }
  async function attempt() {
    if (!wanted || trying) return;
    trying = true;
    try {
      const answer = await fetch("/stop", { method: "POST", keepalive: true, signal: AbortSignal.timeout(PATIENCE) });
      if (answer.ok) done();
    } catch { /* said below */ }
    trying = false;
    if (!wanted) return;
    const over = performance.now() - wanted.at > LONGEST;
    words(over ? NOT : NOT_YET);
    if (over) wanted = null; else setTimeout(attempt, AGAIN);
  }
  window.axisbusStop = { begin, heard };
})();
