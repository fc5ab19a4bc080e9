// Opens the scene among files that are dropped onto the page or chosen.
"use strict";

// Files of a drop with their names, including files in folders.
async function dropped(items) {
  const found = [];
  const walk = async (entry) => {
    if (entry.isFile) {
      const file = await new Promise((done, failed) => entry.file(done, failed));
      found.push([entry.fullPath.replace(/^\//, ""), file]);
      return;
    }
    const reader = entry.createReader();
    for (;;) {
      const entries = await new Promise((done, failed) => reader.readEntries(done, failed));
      if (!entries.length) return;
      for (const each of entries) await walk(each);
    }
  };
  // The browser clears the items at the first await.
  const all = [...items].map((item) => [item.webkitGetAsEntry?.(), item.getAsFile()]);
  for (const [entry, file] of all) {
    if (entry) await walk(entry);
    else if (file) found.push([file.name, file]);
  }
  return found;
}

// Sends files to the viewer, which opens the scene among them.
async function openFiles(files) {
  if (!files.length) return;
  const list = new TextEncoder().encode(JSON.stringify(files.map(([name, file]) => ({ name, size: file.size }))));
  const length = new Uint8Array(4);
  new DataView(length.buffer).setUint32(0, list.length, true);
  const body = new Blob([length, list, ...files.map(([, file]) => file)]);
  toast(`Opening ${files.length === 1 ? files[0][0] : `${files.length} files`}`, 60000);
  let answer;
  try {
    answer = await fetch("open", { method: "POST", headers: { "Content-Type": "application/octet-stream" }, body });
  } catch {
    return toast("The viewer takes no such files: are they more than 256 MiB?", 8000);
  }
  toast(answer.ok ? "Opened. The command needs the file's own path." : await answer.text(), 8000);
}

$("open").onclick = () => $("files").click();
$("files").onchange = (event) => {
  openFiles([...event.target.files].map((file) => [file.webkitRelativePath || file.name, file]));
  event.target.value = "";
};
document.addEventListener("dragover", (event) => {
  if (![...event.dataTransfer.types].includes("Files")) return;
  event.preventDefault();
  document.body.classList.add("dropping");
});
document.addEventListener("dragleave", (event) => event.relatedTarget || document.body.classList.remove("dropping"));
document.addEventListener("drop", async (event) => {
  document.body.classList.remove("dropping");
  if (![...event.dataTransfer.types].includes("Files")) return;
  event.preventDefault();
  openFiles(await dropped(event.dataTransfer.items));
});
