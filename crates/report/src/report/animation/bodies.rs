//! Road users from above, each in its own frame: x forward, y left, in metres.
//!
//! Their size is that of their bodies. Glass and lamps distinguish the front
//! from the rear. The fill is the colour of the role.

use maud::{Markup, html};

use super::write::n;
use crate::scene::{AgentDescription, BodyFigure, Role};

/// CSS class of an agent's colour on the page: ego, ado by number, or scripted.
pub(in crate::report) fn colour_class(agents: &[AgentDescription], who: usize) -> String {
    let role = agents[who].role;
    let before = agents[..who]
        .iter()
        .filter(|agent| agent.role == role)
        .count();
    match role {
        Role::Ego => "c-ego".to_owned(),
        // The style has four colours of ados, which repeat.
        Role::Ado => format!("c-ado{}", before % 4),
        Role::Scripted => "c-by".to_owned(),
    }
}

/// Shape of a body.
pub(super) fn body(agent: &AgentDescription) -> Markup {
    let [length_m, width_m, _] = agent.size_m;
    let body = BodySize { length_m, width_m };
    match (agent.body.as_str(), agent.figure()) {
        // On a grid, shapes and not only colours distinguish the ego from the
        // ados.
        ("cell", _) if agent.role == Role::Ego => body.hull(0.12),
        ("cell", _) => html! { circle class="paint" r=(n(0.5 * length_m, 3)) {} },
        (_, BodyFigure::Person) => body.person(),
        (_, BodyFigure::TwoWheeler) => body.two_wheeler(),
        (_, BodyFigure::Car) => body.car(&CAR),
        (_, BodyFigure::Van) => body.car(&VAN),
        (_, BodyFigure::Truck) => body.truck(),
    }
}

/// Windows of a vehicle, in shares of the length from the middle.
struct Cabin {
    /// Rear and front end of the windscreen.
    windscreen: (f64, f64),
    /// Rear and front end of the rear window, if any.
    rear_window: Option<(f64, f64)>,
}

const CAR: Cabin = Cabin {
    windscreen: (0.10, 0.24),
    rear_window: Some((-0.37, -0.27)),
};
const VAN: Cabin = Cabin {
    windscreen: (0.26, 0.38),
    rear_window: None,
};

struct BodySize {
    length_m: f64,
    width_m: f64,
}

impl BodySize {
    /// Outline in the size of the body.
    fn hull(&self, rounding: f64) -> Markup {
        self.bar("paint", (-0.5, 0.5), (-0.5, 0.5), rounding * self.width_m)
    }

    /// Rectangle by shares of length and width.
    fn bar(&self, class: &str, x: (f64, f64), y: (f64, f64), round_m: f64) -> Markup {
        let (length, width) = (self.length_m, self.width_m);
        html! {
            rect class=(class) x=(n(x.0 * length, 3)) y=(n(y.0 * width, 3)) width=(n((x.1 - x.0) * length, 3)) height=(n((y.1 - y.0) * width, 3)) rx=(n(round_m, 3)) {}
        }
    }

    /// Window that narrows from `wide` to `narrow`, in shares.
    fn glass(&self, wide: (f64, f64), narrow: (f64, f64)) -> Markup {
        let corners = [
            (wide.0, wide.1),
            (wide.0, -wide.1),
            (narrow.0, -narrow.1),
            (narrow.0, narrow.1),
        ]
        .map(|(x, y)| format!("{},{}", n(x * self.length_m, 3), n(y * self.width_m, 3)));
        html! { polygon class="glass" points=(corners.join(" ")) {} }
    }

    fn lamps(&self) -> Markup {
        html! {
            @for side in [(-0.46, -0.22), (0.22, 0.46)] {
                (self.bar("lamp", (0.465, 0.5), side, 0.04))
                (self.bar("tail", (-0.5, -0.455), side, 0.04))
            }
        }
    }

    fn car(&self, cabin: &Cabin) -> Markup {
        let (from, to) = cabin.windscreen;
        // Without a rear window the roof reaches almost to the rear.
        let roof_from = cabin.rear_window.map_or(-0.46, |(_, front)| front);
        html! {
            (self.hull(0.22))
            (self.bar("roof", (roof_from, from), (-0.36, 0.36), 0.1))
            (self.glass((to, 0.43), (from, 0.35)))
            @if let Some((rear, front)) = cabin.rear_window { (self.glass((rear, 0.40), (front, 0.34))) }
            (self.lamps())
        }
    }

    fn truck(&self) -> Markup {
        html! {
            (self.hull(0.06))
            (self.bar("cargo", (-0.5, 0.26), (-0.5, 0.5), 0.06))
            (self.glass((0.475, 0.46), (0.42, 0.44)))
            (self.lamps())
        }
    }

    fn two_wheeler(&self) -> Markup {
        html! {
            (self.bar("tyre", (0.22, 0.5), (-0.09, 0.09), 0.05))
            (self.bar("tyre", (-0.5, -0.2), (-0.09, 0.09), 0.05))
            (self.bar("paint", (-0.3, 0.32), (-0.16, 0.16), 0.1))
            (self.bar("tyre", (0.17, 0.2), (-0.5, 0.5), 0.02))
            ellipse class="paint" cx=(n(-0.06 * self.length_m, 3)) rx=(n(0.13 * self.length_m, 3)) ry=(n(0.42 * self.width_m, 3)) {}
            circle class="head" cx=(n(0.01 * self.length_m, 3)) r=(n(0.16_f64.min(0.22 * self.width_m), 3)) {}
            (self.bar("tail", (-0.5, -0.46), (-0.08, 0.08), 0.0))
        }
    }

    /// Shoulders, a head and a face that looks ahead.
    ///
    /// A ring surrounds it, because a person is small beside cars.
    fn person(&self) -> Markup {
        let (length, width) = (self.length_m, self.width_m);
        let nose = [(0.5, 0.0), (0.22, 0.2), (0.22, -0.2)]
            .map(|(x, y)| format!("{},{}", n(x * length, 3), n(y * width, 3)));
        html! {
            circle class="ring" r="1.1" {}
            ellipse class="paint" rx=(n(0.5 * length, 3)) ry=(n(0.5 * width, 3)) {}
            polygon class="head" points=(nose.join(" ")) {}
            circle class="head" r=(n(0.27 * length.min(width), 3)) {}
        }
    }
}
