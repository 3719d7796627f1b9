//! Prometheus's text form: <https://prometheus.io/docs/instrumenting/exposition_formats/>.

use std::fmt::Write;

/// Text that grows metric by metric.
#[derive(Debug, Default)]
pub(super) struct Text(String);

impl Text {
    /// What stands before the samples of a metric.
    pub(super) fn head(&mut self, name: &str, kind: &str, help: &str) {
        self.line(format_args!("# HELP {name} {help}"));
        self.line(format_args!("# TYPE {name} {kind}"));
    }

    /// One value.
    pub(super) fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: f64) {
        let labels: Vec<String> =
            labels.iter().map(|(key, of)| format!("{key}=\"{}\"", escape(of))).collect();
        if labels.is_empty() {
            self.line(format_args!("{name} {value}"));
        } else {
            self.line(format_args!("{name}{{{}}} {value}", labels.join(",")));
        }
    }

    /// A histogram: `counts` of values up to each of `limits`, each value counted once.
    pub(super) fn histogram(
        &mut self,
        (name, help): (&str, &str),
        limits: &[f64],
        counts: &[u64],
        count: u64,
        sum: f64,
    ) {
        self.head(name, "histogram", help);
        let bucket = format!("{name}_bucket");
        let mut below = 0;
        for (limit, count) in limits.iter().zip(counts) {
            below += count;
            self.sample(&bucket, &[("le", &limit.to_string())], below as f64);
        }
        self.sample(&bucket, &[("le", "+Inf")], count as f64);
        self.sample(&format!("{name}_sum"), &[], sum);
        self.sample(&format!("{name}_count"), &[], count as f64);
    }

    pub(super) fn into_string(self) -> String {
        self.0
    }

    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        writeln!(self.0, "{line}").unwrap_or_default();
    }
}

fn escape(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_are_cumulative_and_end_in_infinity() {
        let mut text = Text::default();
        text.histogram(("t", "Time"), &[0.5, 1.0], &[2, 1], 4, 7.25);
        assert_eq!(
            text.into_string(),
            "# HELP t Time\n# TYPE t histogram\nt_bucket{le=\"0.5\"} 2\nt_bucket{le=\"1\"} 3\n\
             t_bucket{le=\"+Inf\"} 4\nt_sum 7.25\nt_count 4\n"
        );
    }

    #[test]
    fn labels_cannot_break_out() {
        let mut text = Text::default();
        text.sample("m", &[("reason", "a\"b\\\n")], 1.0);
        assert_eq!(text.into_string(), "m{reason=\"a\\\"b\\\\\\n\"} 1\n");
    }
}
