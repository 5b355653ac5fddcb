// Draws the plots of the page; what is not drawn stays the picture that it is.
(() => {
  const night = matchMedia("(prefers-color-scheme: dark)");
  const colours = JSON.parse(document.getElementById("night").textContent);
  let text = document.getElementById("plots").textContent;
  if (night.matches) text = text.replace(/#[0-9a-f]{6}/g, (colour) => colours[colour] ?? colour);
  const plots = JSON.parse(text);
  const places = {};
  for (const [name, root] of Object.entries(plots.roots)) places[root] = `plot-${name}`;
  Bokeh.set_log_level("error");
  Bokeh.embed.embed_items({ report: plots.document }, [{ docid: "report", roots: places, root_ids: Object.keys(places) }])
    .then(() => document.documentElement.classList.add("drawn"))
    .catch((error) => console.error(error));
  // The colours are the plots' own: another scheme needs them drawn again.
  night.addEventListener("change", () => location.reload());
})();
