//! List of the search methods.
//!
//! `--method` with its help, the refusal of unused options, rows and the table in
//! `docs/guide/search.md` follow from it.
//! A new method is a file beside this one, with a type that implements `SearchMethod`,
//! and a line in the list.

use super::found::SearchResult;
use super::method::{
    MethodInfo, MethodOption, MethodSettings, SearchError, SearchMethod, StartSearch,
};
use crate::run_dir::{AdversaryId, Unconfirmed};

macro_rules! methods {
    ($(
        $(#[doc = $about:literal])+
        $(#[cfg($when:meta)])?
        $file:ident::$kind:ident $(<$life:lifetime>)?;
    )+) => {
        $( $(#[cfg($when)])? #[allow(unreachable_pub)] pub use super::$file::$kind; )+

        /// Method by which sequences of actions are chosen.
        #[derive(Clone, Copy, Debug)]
        pub enum Method<'a> {
            $( $(#[doc = $about])+ $(#[cfg($when)])? $kind($kind $(<$life>)?), )+
        }

        $(
            $(#[cfg($when)])?
            impl<'a> From<$kind $(<$life>)?> for Method<'a> {
                fn from(method: $kind $(<$life>)?) -> Method<'a> {
                    Method::$kind(method)
                }
            }
        )+

        /// All methods, in the order of the help.
        static METHODS: &[MethodInfo] = &[$( $(#[cfg($when)])? $kind::INFO, )+];

        impl<'a> Method<'a> {
            /// Returns the method of a name, as given to `--method`.
            ///
            /// # Errors
            /// Returns an error if the name is unknown or a required setting is missing.
            pub fn named(
                name: &str,
                settings: &MethodSettings<'a>,
            ) -> Result<Method<'a>, SearchError> {
                $(
                    $(#[cfg($when)])?
                    if name == $kind::INFO.name {
                        return Ok($kind::with(settings)?.into());
                    }
                )+
                Err(unknown(name))
            }

            /// Returns the name, the help and the options of the method.
            pub fn info(&self) -> MethodInfo {
                match self {
                    $( $(#[cfg($when)])? Method::$kind(_) => $kind::INFO, )+
                }
            }

            /// Returns the name in rows, with the budget and the unconfirmed sequences.
            pub fn text(&self, budget: u64, unconfirmed: Option<Unconfirmed>) -> String {
                match self {
                    $( $(#[cfg($when)])? Method::$kind(it) => it.text(budget, unconfirmed), )+
                }
            }

            pub(super) fn solve(&self, one: StartSearch<'_>) -> Option<SearchResult> {
                match self {
                    $( $(#[cfg($when)])? Method::$kind(it) => it.solve(one), )+
                }
            }
        }
    };
}

methods! {
    /// A uniformly random action at each decision.
    uniform::Uniform;
    /// A uniformly random action, held for five decisions.
    hold::Hold;
    /// The cross-entropy method with the rulebook's reward as fitness.
    cem::Cem;
    /// Mutations of the nearest counterexamples of a training.
    mutate::Mutate<'a>;
    /// Runs that a trained policy proposes.
    guided::Guided<'a>;
    /// All sequences with at most a given number of action switches, fewest first.
    switches::Switches;
    /// Method of the tests, which shows that a file and a line are enough.
    #[cfg(test)]
    example_search::EachAction;
}

impl Method<'_> {
    /// Returns all methods in the order of the help.
    pub fn all() -> &'static [MethodInfo] {
        METHODS
    }
}

impl Method<'_> {
    /// Returns the identity of its rows.
    pub(super) fn adversary(&self) -> AdversaryId {
        match self {
            Method::Guided(_) => AdversaryId::Guided,
            // The other methods are told apart by the words of their rows.
            _ => AdversaryId::SEARCH,
        }
    }
}

impl MethodInfo {
    /// Refuses options that have no effect.
    ///
    /// # Errors
    /// Names the first given option that the method does not take.
    pub fn refuse_others(&self, given: &[MethodOption]) -> Result<(), SearchError> {
        let Some(option) = given.iter().find(|option| !self.takes(**option)) else {
            return Ok(());
        };
        Err(SearchError::DoesNothing {
            option: *option,
            method: self.name,
            takes: self.takes,
        })
    }
}

impl SearchError {
    /// The fix.
    pub fn help(&self) -> String {
        match self {
            SearchError::UnknownMethod { .. } => {
                let names = METHODS.iter().map(|method| quoted(method.name));
                format!("there are {}", names.collect::<Vec<_>>().join(", "))
            }
            SearchError::DoesNothing {
                option,
                method,
                takes,
            } => {
                let own: Vec<String> = takes.iter().map(|o| quoted(o.usage())).collect();
                let takes = if own.is_empty() {
                    "no option".to_owned()
                } else {
                    own.join(" and ")
                };
                let others = takers(*option, quoted);
                format!("it is for {others}; `{method}` takes {takes}")
            }
            SearchError::NothingToMutate => "name a run directory with `--bank RUN`".to_owned(),
            SearchError::NothingToGuide => "name a run directory with `--guided RUN`".to_owned(),
        }
    }
}

impl MethodOption {
    /// Returns the line in the help: meaning, methods and default.
    pub fn help(self) -> String {
        let (about, default) = (self.about(), self.default_text());
        let methods = takers(self, str::to_owned);
        format!("{about} ({methods}) [default: {default}]")
    }
}

/// Returns the names of the methods that take an option.
fn takers(option: MethodOption, shown: fn(&str) -> String) -> String {
    let takers = METHODS.iter().filter(|method| method.takes(option));
    let names: Vec<String> = takers.map(|method| shown(method.name)).collect();
    names.join(", ")
}

fn unknown(name: &str) -> SearchError {
    SearchError::UnknownMethod {
        name: name.to_owned(),
    }
}

fn quoted(word: &str) -> String {
    format!("`{word}`")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Watch, test_starts};
    use crate::search::method::GuidingPolicy;
    use crate::search::request::SearchRequest;
    use crate::search::search;
    use crate::sim::PlantKind;
    use crate::world::Scenario;

    const GUIDE: &str = include_str!("../../../../docs/guide/search.md");
    const WORLD: &str = include_str!("../../../../worlds/acc.ron");

    /// Policy of the first action.
    struct Neutral;

    impl crate::rl::Policy for Neutral {
        fn act(&self, _obs: &[f32]) -> usize {
            0
        }

        fn value(&self, _obs: &[f32]) -> f32 {
            0.0
        }
    }

    fn is_shipped(method: &&MethodInfo) -> bool {
        // The table in the guide lists only methods that users can call.
        method.name != EachAction::INFO.name
    }

    #[test]
    fn a_file_and_a_line_are_all_it_takes_to_add_a_method() {
        let world = Scenario::parse("acc.ron", WORLD).expect("a world");
        let weak = world.with(&world.reuse()["weak brakes"]).expect("it fits");
        let world = weak.on(PlantKind::Kinematic);
        let starts = test_starts(&world, 77, 12, &Watch::unwatched()).expect("not stopped");
        let row = |method: Method<'_>, budget| {
            let request = SearchRequest {
                scenario: &world,
                ego: "nominal",
                method,
                budget,
                starts: &starts,
            };
            search(&request, &Watch::unwatched()).row
        };
        let settings = MethodSettings::default();
        let constants = Method::named("constants", &settings).expect("in the list");
        let few = row(constants, 2);
        assert_eq!(few.method, "constants, 2 simulations");
        let budgets: Vec<u64> = few.anytime.iter().map(|at| at.budget).collect();
        assert_eq!(budgets, [2]);
        let actions = world.world().spaces().actions as u64;
        let all = row(constants, actions);
        let none_switched = row(Switches(0).into(), 0);
        assert_eq!(all.solved, none_switched.solved);
        assert_eq!(all.sims_per_start, none_switched.sims_per_start);
        assert!(all.successes > 0 && few.sims_per_start < all.sims_per_start);
        // The method takes a budget and refuses the other options.
        assert!(MethodOption::Budget.help().contains("constants"));
        assert!(!MethodOption::Bank.help().contains("constants"));
        let refused = constants.info().refuse_others(&[MethodOption::Bank]);
        let error = refused.expect_err("it mutates nothing").to_string();
        assert_eq!(error, "`--bank` does nothing with `--method constants`");
    }

    #[test]
    fn every_method_is_found_by_its_name_and_refuses_what_it_ignores() {
        let stored = crate::run_dir::Stored::new(Vec::new(), &[]);
        let settings = MethodSettings {
            stored: Some(&stored),
            guide: Some(GuidingPolicy(&Neutral)),
            ..MethodSettings::default()
        };
        for method in Method::all() {
            let named = Method::named(method.name, &settings).expect("in the list");
            assert_eq!(named.info(), *method);
            assert!(!method.help.ends_with('.'), "{}", method.help);
            for option in <MethodOption as strum::VariantArray>::VARIANTS {
                let fits = method.refuse_others(&[*option]).is_ok();
                assert_eq!(fits, method.takes(*option), "{} {option:?}", method.name);
            }
        }
        let error = Method::named("magic", &settings).unwrap_err();
        assert_eq!(error.to_string(), "no search method is called `magic`");
        let error = Method::named("mutate", &MethodSettings::default()).unwrap_err();
        assert!(error.to_string().contains("counterexamples"), "{error}");
        let error = Method::named("guided", &MethodSettings::default()).unwrap_err();
        assert!(error.help().contains("--guided RUN"), "{error}");
    }

    #[test]
    fn the_table_of_the_guide_has_every_method_with_its_options() {
        let (_, table) = GUIDE.split_once("| `--method` |").expect("the table");
        let (table, _) = table.split_once("\n\n").expect("its end");
        let row = |method: &MethodInfo| {
            let options: Vec<String> = method
                .takes
                .iter()
                .map(|&o| format!("`{}` ({})", o.usage(), method.default_text(o)))
                .collect();
            format!(
                "| `{}` | {} | {} |",
                method.name,
                method.help,
                options.join(", ")
            )
        };
        let rows: Vec<String> = METHODS.iter().filter(is_shipped).map(row).collect();
        let table: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(table, rows);
    }
}
