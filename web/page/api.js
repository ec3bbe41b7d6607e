/** The OpenAPI page: what the server says of itself, in the usual form. */

import SwaggerUI from "swagger-ui-dist/swagger-ui-es-bundle.js";
import "swagger-ui-dist/swagger-ui.css";

SwaggerUI({ dom_id: "#api", url: new URL("../openapi.json", document.baseURI).href, validatorUrl: null });
