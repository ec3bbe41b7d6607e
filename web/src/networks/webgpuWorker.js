/** The networks' thread with the runtime for WebGPU bundled into it. */

import * as ort from "onnxruntime-web/jspi";
import { provideRuntime } from "./runtime.js";
import "./worker.js";

provideRuntime(ort);
