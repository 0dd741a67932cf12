"use strict";
// A run while it goes on: rows and events from the program, orders to it.

/** Simulated time that stays on the page, s. */
const KEPT_ROWS = 12000, SHOWN_S = 10;

function connect(page) {
  page.orders = () => {};
}
