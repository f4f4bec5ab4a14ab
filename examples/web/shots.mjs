// Takes screenshots of the page in headless Chromium: node shots.mjs FOLDER [QUERY ...]
//
// CHROMIUM is the browser; by default /usr/bin/chromium. The files are 0.png, 1.png and so on.

import { readFile } from "node:fs/promises";
import { extname, join } from "node:path";
import { chromium } from "playwright-core";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".glb": "model/gltf-binary" };
const [folder, ...queries] = process.argv.slice(2);
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage({ viewport: { width: 800, height: 800 } });
page.on("console", (message) => console.log(message.text()));
page.on("pageerror", (error) => {
  throw error;
});
await page.route("http://page/**", async (route) => {
  const path = new URL(route.request().url()).pathname;
  const body = await readFile(join(import.meta.dirname, path));
  await route.fulfill({ body, contentType: TYPES[extname(path)] });
});
for (const [index, query] of queries.entries()) {
  await page.goto(`http://page/index.html?still&${query}`);
  await page.waitForSelector("body[data-ready]");
  await page.screenshot({ path: join(folder, `${index}.png`) });
}
await browser.close();
