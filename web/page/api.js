/** The page of the server's OpenAPI description. */

import SwaggerUI from "swagger-ui-dist/swagger-ui-es-bundle.js";
import "swagger-ui-dist/swagger-ui.css";

SwaggerUI({ dom_id: "#api", url: new URL("../openapi.json", document.baseURI).href, validatorUrl: null });
