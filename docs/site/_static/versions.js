// Lets the reader choose another version, on a site to which several were published (docs/site/published.py).
// Its top folder has a list of them, versions.js, that calls axisbusVersions. A site without it, as "make docs" builds it, shows nothing.
"use strict";

document.addEventListener("DOMContentLoaded", () => {
  const place = document.querySelector(".sidebar-versions");
  const top = `${document.documentElement.dataset.content_root}../`;
  if (!place) return;

  window.axisbusVersions = (versions) => {
    const shown = place.dataset.version;
    const label = document.createElement("label");
    const choice = document.createElement("select");
    for (const version of versions) {
      choice.add(new Option(version, version, version === shown, version === shown));
    }
    choice.addEventListener("change", () => { location.href = `${top}${choice.value}/index.html`; });
    label.append("Version ", choice);
    place.append(label);
    if (shown !== versions[0]) {
      const older = document.createElement("p");
      older.textContent = `This is not the newest version, which is ${versions[0]}.`;
      place.append(older);
    }
    place.hidden = false;
  };

  const list = document.createElement("script");
  list.src = `${top}versions.js`;
  document.head.append(list);
});
