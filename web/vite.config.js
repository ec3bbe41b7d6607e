import { fileURLToPath } from "node:url";
import { defineConfig } from "vite";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));

export default defineConfig({
  base: "./", // the page works from any folder of any host
  build: {
    outDir: here("../src/anyprobe/serve/page"),
    emptyOutDir: true,
    target: "es2022",
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
    chunkSizeWarningLimit: 3000,
    rolldownOptions: { input: { page: here("index.html"), api: here("api/index.html") } },
  },
  worker: { format: "es" },
});
