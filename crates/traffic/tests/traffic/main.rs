//! Recorded traffic: reading, lanes, situations, rules and rarity, on synthetic rows.

mod reading;
mod rules;
mod situations;
mod synthetic;
