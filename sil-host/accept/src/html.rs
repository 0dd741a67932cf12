//! The report as a page: no scripts, no network.

use core::fmt::Write;

use painleve_chart::markup::{document, escaped};

use crate::report::{Acceptance, Verdict};

fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "passed",
        Verdict::Noted => "noted",
        Verdict::Failed => "failed",
    }
}

impl Acceptance {
    /// Returns the report as an HTML page.
    pub fn html(&self) -> String {
        let mut body = String::new();
        // Writing to a string does not fail.
        let _ = write!(
            body,
            "<p class=\"{}\">{}</p><p>painleve {}, sources {}</p>",
            class(self.verdict),
            self.verdict.word(),
            self.version,
            self.sources,
        );
        for step in &self.steps {
            let _ = write!(
                body,
                "<h2>{} <span class=\"{}\">{}</span></h2><p>{} ({:.1} s)</p>\
                 <table><tr><th>what<th>measured<th>expected<th>verdict</tr>",
                escaped(step.name),
                class(step.verdict),
                step.verdict.word(),
                escaped(step.question),
                step.duration_s,
            );
            for check in &step.checks {
                let _ = write!(
                    body,
                    "<tr><td>{}<td>{}<td>{}<td class=\"{}\">{}</tr>",
                    escaped(&check.what),
                    escaped(&check.measured),
                    escaped(&check.expected),
                    class(check.verdict),
                    check.verdict.word(),
                );
            }
            body.push_str("</table>");
        }
        let chip = self.chip.unwrap_or("an unknown chip");
        document(&format!("Acceptance: {chip}"), &body)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Check, StepReport};

    #[test]
    fn every_check_is_on_the_page_and_its_text_is_escaped() {
        let checks = vec![
            Check::new("clock", "167.9 MHz", "168 MHz ± 0.2 %", true),
            Check::new("level of PB4 <low>", "1", "0", false),
            Check::note("revision", "0x1001"),
        ];
        let step = StepReport {
            name: "clock",
            question: "Which?",
            verdict: Verdict::of(&checks),
            duration_s: 1.0,
            checks,
        };
        let acceptance = Acceptance::new(None, vec![step]);
        assert_eq!(acceptance.failed(), ["clock"]);
        let page = acceptance.html();
        for part in [
            "167.9 MHz",
            "PB4 &lt;low&gt;",
            "0x1001",
            "noted",
            "FAILED",
            "an unknown chip",
        ] {
            assert!(page.contains(part), "{part}: {page}");
        }
    }
}
