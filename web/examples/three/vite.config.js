export default {
  publicDir: "../public", // the photo
  optimizeDeps: { exclude: ["anyprobe"] }, // its worker stays a file of its own
  build: { target: "esnext" },
  server: {
    fs: { allow: ["../../.."] }, // the package and the runtime lie above
    headers: { "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp" }, // threads
  },
};
