// The script of a worker of the page.

import { serve } from "../../wasm/engine.js";
import { TASKS } from "./worker.js";

serve(self, TASKS);
