//! Recorded traffic: reading, lanes, situations, rules and rarity, on synthetic rows.

mod columns;
mod crossings;
mod foreign;
mod meta;
mod naturalness;
mod openscenario;
mod osi;
mod pictures;
mod reading;
mod rules;
mod situations;
mod synthetic;
mod tables;
mod units;
mod worlds;
