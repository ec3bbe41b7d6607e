/** The networks' thread with the runtime bundled into it. */

import * as ort from "onnxruntime-web/wasm";
import { provideRuntime } from "./runtime.js";
import "./worker.js";

provideRuntime(ort);
