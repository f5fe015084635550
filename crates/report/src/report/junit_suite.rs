//! JUnit XML: suites of test cases, which are counted where they are written.

use crate::xml::XmlElement;

/// Suite of test cases.
pub(super) struct TestSuite {
    pub name: String,
    /// Processor time in seconds, if it is known.
    pub time_s: Option<f64>,
    pub cases: Vec<TestCase>,
}

/// Test case.
pub(super) struct TestCase {
    /// Class, by which servers group cases.
    pub class: String,
    pub name: String,
    /// Processor time in seconds, if it is known.
    pub time_s: Option<f64>,
    /// Requirement that the case tests.
    pub requirement: Option<String>,
    pub outcome: TestOutcome,
}

/// Outcome of a test case.
pub(super) enum TestOutcome {
    Passed,
    Failed(TestMessage),
    /// The test did not run.
    Error(TestMessage),
    /// The test gives no answer, for a reason.
    Skipped(String),
}

/// Reason of a failure or an error.
pub(super) struct TestMessage {
    /// Kind in a word or two.
    pub kind: &'static str,
    /// One line.
    pub message: String,
    /// Details.
    pub words: String,
}

/// Returns the suites as a document.
pub(super) fn junit(suites: &[TestSuite]) -> String {
    let all: Vec<&TestCase> = suites.iter().flat_map(|suite| &suite.cases).collect();
    let total_s = suites.iter().map(|suite| suite.time_s).sum::<Option<f64>>();
    let counts = counted("testsuites", "brakecheck", &all);
    let root = timed(counts, total_s).children(suites.iter().map(element_of));
    // Invariant: memory takes any document.
    root.document().unwrap_or_default()
}

fn element_of(suite: &TestSuite) -> XmlElement {
    let cases: Vec<&TestCase> = suite.cases.iter().collect();
    let skipped = count(&cases, |it| matches!(it, TestOutcome::Skipped(_)));
    let element = counted("testsuite", &suite.name, &cases).text("skipped", skipped);
    timed(element, suite.time_s).children(suite.cases.iter().map(TestCase::element))
}

fn counted(element: &'static str, name: &str, cases: &[&TestCase]) -> XmlElement {
    XmlElement::new(element)
        .text("name", name)
        .text("tests", cases.len().to_string())
        .text(
            "failures",
            count(cases, |it| matches!(it, TestOutcome::Failed(_))),
        )
        .text(
            "errors",
            count(cases, |it| matches!(it, TestOutcome::Error(_))),
        )
}

fn count(cases: &[&TestCase], is_one: fn(&TestOutcome) -> bool) -> String {
    let found = cases.iter().filter(|case| is_one(&case.outcome));
    found.count().to_string()
}

fn timed(element: XmlElement, time_s: Option<f64>) -> XmlElement {
    match time_s {
        Some(time_s) => element.text("time", format!("{time_s:.3}")),
        None => element,
    }
}

impl TestCase {
    fn element(&self) -> XmlElement {
        let named = XmlElement::new("testcase")
            .text("classname", &self.class)
            .text("name", &self.name);
        let requirement = self.requirement.as_ref().map(|it| {
            let property = XmlElement::new("property").text("name", "requirement");
            XmlElement::new("properties").child(property.text("value", it))
        });
        let case = timed(named, self.time_s).children(requirement);
        match &self.outcome {
            TestOutcome::Passed => case,
            TestOutcome::Failed(it) => case.child(it.element("failure")),
            TestOutcome::Error(it) => case.child(it.element("error")),
            TestOutcome::Skipped(why) => {
                case.child(XmlElement::new("skipped").text("message", why))
            }
        }
    }
}

impl TestMessage {
    fn element(&self, name: &'static str) -> XmlElement {
        XmlElement::new(name)
            .text("type", self.kind)
            .text("message", &self.message)
            .words(&self.words)
    }
}
