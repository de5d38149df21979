// The script of the configuration view: starts and cancels jobs, sends a file, stores the last backup, shows the result of a job.
"use strict";
(() => {
  const { send, say, reasons, make, put, table, saved, ask } = window.axisbusPage;
  const one = (selector) => document.querySelector(selector);
  let section, page = 0, controls = false, job = null, file = null, known = false, backup = null;

  // -- out ------------------------------------------------------------------------------------------------------------------------
  function told(message) {
    const sent = send({ ...message, node: Number(one("#config-node").value) });
    if (!sent) say("failed", "There is no connection: nothing was sent.", "");
  }
  // The server keeps one file of each page, for as long as that is open.
  async function bring(name, blob) {
    file = { name, blob };
    known = false;
    show();
    const most = Number(section.dataset.most), large = `${name} has ${blob.size} bytes: at most ${most} are taken.`;
    put(one("#file-state"), blob.size > most ? large : `Reading ${name} …`);
    if (blob.size > most) return;
    let found = { name, error: { message: `${name} could not be sent.`, observed: "", remedy: "choose it again" } };
    try {
      const answer = await fetch(`/config/file?page=${page}&name=${encodeURIComponent(name)}`, { method: "POST", body: blob });
      if (answer.ok) found = await answer.json();
    } catch { /* said as above */ }
    if (file.blob !== blob) return; // another one was chosen meanwhile
    known = !found.error;
    put(one("#file-state"), found.error ? reasons(found.error) : `${found.name}: ${found.text}`);
    show();
  }
  async function fetchBackup(name) {
    try {
      const answer = await fetch(`/config/backup?page=${page}`);
      if (!answer.ok) throw new Error(String(answer.status));
      backup = { name, blob: await answer.blob() };
    } catch {
      return say("failed", "The backup could not be loaded.", "make it again");
    }
    put(one("#backup-state"), `${name}, ${backup.blob.size} bytes`);
    show();
  }

  // -- in -------------------------------------------------------------------------------------------------------------------------
  function take(next) {
    job = next;
    if (job.over && job.report?.file && job.page === page) fetchBackup(job.report.file);
    report();
    show();
  }
  function words() {
    if (!job) return "No job yet.";
    const other = job.page === page ? "" : `, for page ${job.page}`;
    const what = `${job.what[0].toUpperCase()}${job.what.slice(1)} of node ${job.node}${other}`;
    const far = `${job.done} of ${job.whole || "?"} objects`;
    if (!job.over) return `${what}: ${far}`;
    const nothing = job.kind === "restore" ? "" : ", nothing was written";
    return job.report ? `${what}: ${job.report.text}` : `${what} was not completed: ${far} were read${nothing}`;
  }
  function show() {
    const runs = Boolean(job && !job.over), bar = one("#config-bar");
    bar.max = job?.whole || 1;
    bar.value = job?.done ?? 0;
    put(one("#config-state"), words());
    one("#backup").disabled = runs || !one("#config-node").value;
    for (const name of ["#compare", "#would-restore"]) one(name).disabled = runs || !known;
    for (const name of ["#backup-save", "#file-backup"]) one(name).disabled = !backup;
    one("#restore").disabled = runs || !known || !controls;
    one("#config-end").disabled = !runs || !(controls || job.page === page);
  }
  function report() {
    const found = job.report, rows = found?.rows ?? [];
    put(one("#config-error"), reasons(job.error ?? found?.broken));
    put(one("#config-lines"), (found?.lines ?? []).join("\n"));
    const shown = rows.length ? [table(found.titles, rows)] : [];
    const more = `The first ${rows.length} of ${found?.all}; all: by axisbus config`;
    if (rows.length < found?.all) shown.unshift(make("p", more, "hint"));
    one("#config-rows").replaceChildren(...shown);
    one("#config-refused").hidden = !found?.refusal;
    put(one("#config-refusal"), reasons(found?.refusal));
    put(one("#config-command"), found?.command ?? "");
  }

  // -- hands ------------------------------------------------------------------------------------------------------------------------
  function hands() {
    one("#backup").addEventListener("click", () => told({ do: "backup" }));
    one("#compare").addEventListener("click", () => told({ do: "compare" }));
    one("#would-restore").addEventListener("click", () => told({ do: "would_restore" }));
    one("#restore").addEventListener("click", () => {
      const node = one("#config-node").value, name = file.name;
      const text = `Restore the settings of node ${node} from ${name}? They take effect at the next move of the drive.`;
      ask(text, () => file?.name === name && one("#config-node").value === node && told({ do: "restore", sure: true }));
    });
    one("#config-end").addEventListener("click", () => told({ do: "job_end" }));
    one("#backup-save").addEventListener("click", () => saved(backup.blob, backup.name));
    one("#file-backup").addEventListener("click", () => bring(backup.name, backup.blob));
    one("#config-file").addEventListener("change", ({ target }) => {
      if (target.files.length) bring(target.files[0].name, target.files[0]);
      target.value = ""; // so that the same one may be chosen again, when it has changed
    });
  }
  document.addEventListener("axisbus-own", ({ detail: own }) => {
    if (!section) return;
    const again = own.page !== page, changed = own.mine !== controls;
    [page, controls] = [own.page, own.mine];
    if (again && file) bring(file.name, file.blob); // another connection: the server has forgotten it
    if (own.configured) take(own.configured);
    else if (again || changed) show();
  });
  const mounted = setInterval(() => {
    if (!one("#config-node") || !one("#config-command")) return;
    section = one("main > section[data-view=config]");
    clearInterval(mounted);
    hands();
    show();
  }, 20);
})();
