//! Recorded traffic: reading, lanes, situations, rules and rarity, on synthetic rows.

mod naturalness;
mod reading;
mod rules;
mod situations;
mod synthetic;
mod worlds;
