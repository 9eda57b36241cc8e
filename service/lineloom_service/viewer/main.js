import { App } from "./app.js";

const app = new App();
// For the browser's console, and for tests.
Object.assign(window, { lineloom: app });
app.start();
