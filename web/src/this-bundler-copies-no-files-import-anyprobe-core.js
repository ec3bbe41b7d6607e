/**
 * What "anyprobe" is to a bundler that copies no files, such as esbuild and Rollup: weights, runtime and
 * worker would be missing at run time. The build fails, as nothing is exported, and the error names this file.
 */

export {};
