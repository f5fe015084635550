//! Traffic lights of a world file: their roads, stop lines and drives.

use super::ado_actions::{self, ActsAs};
use super::agents::Agents;
use super::roads;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{Light, LightDrive};
use crate::world_file::{AgentFile, LightFile, ScenarioFile};

impl Agents<'_> {
    /// Reads a light, and reports its mistakes.
    pub(super) fn light(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        file: &ScenarioFile,
        entry: &AgentFile,
    ) -> Option<Light> {
        let AgentFile::Light {
            name,
            road: _,
            signal: _,
            line_m,
            phase,
            drive,
        } = entry
        else {
            return None;
        };
        let road = roads::number(problems, path, file, entry);
        if line_m.is_none() {
            let help = "write `line_m: …`, or `signal: …` where `road` is `OpenDrive(…)`";
            let what = format!("nothing says where the stop line of `{name}` is");
            problems.add(path, what, "without a line", Some(help.to_owned()));
        }
        // Everything is read before a missing part ends the reading.
        let drive = self.light_drive(problems, path, name, drive);
        Some(Light {
            name: name.clone(),
            road: road?,
            line_m: (*line_m)?,
            phase: *phase,
            drive: drive?,
        })
    }

    fn light_drive(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        name: &str,
        drive: &LightFile,
    ) -> Option<LightDrive> {
        let path = path.to("drive");
        Some(match drive {
            LightFile::Trained(file) => {
                LightDrive::Trained(self.trained(problems, &path, name, file, ActsAs::Light)?)
            }
            LightFile::Schedule(schedule) => {
                // Equal times would leave the order of phases open.
                let sorted = schedule.0.is_sorted_by(|a, b| a.0 < b.0);
                if !sorted || schedule.0.iter().any(|(at_s, _)| *at_s < 0.0) {
                    let what = "the times of a schedule rise from 0 on".to_owned();
                    let help = "write `Schedule([(0.0, Yellow), (2.0, Red)])`".to_owned();
                    problems.add(&path, what, "out of order", Some(help));
                }
                LightDrive::Schedule(schedule.clone())
            }
            LightFile::Ado(ado) => {
                ado_actions::check(problems, &path, ado, ActsAs::Light);
                self.rules_of(problems, &path, name, ado);
                LightDrive::Ado {
                    actions: ado.actions.clone(),
                    neutral: ado.neutral,
                }
            }
        })
    }
}
