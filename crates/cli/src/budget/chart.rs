//! Draws a chart of the computing time over the number of knots.

use super::Report;
use std::fmt::Write;

const SIZE: (f64, f64) = (720.0, 420.0);
/// Positions of the left, right, top and bottom ends of the axes (px).
const FRAME: [f64; 4] = [80.0, 520.0, 30.0, 360.0];
const COLOURS: [&str; 5] = ["#30638e", "#00798c", "#2e933c", "#d1495b", "#8f2d56"];

/// Curve of the chart: its name, and its points (knots, p50, p99) with times in seconds.
type Curve = (String, Vec<(usize, f64, f64)>);

/// Draws the times of all horizons on logarithmic axes. Thick lines show p50, thin lines show p99, and the dashed line
/// shows the period.
pub(super) fn svg(report: &Report) -> String {
    let curves = curves(report);
    let period = report.verdicts.first().and_then(|v| v.period_s);
    let points = || curves.iter().flat_map(|(_, points)| points);
    let times = || points().flat_map(|p| [p.1, p.2]).chain(period).map(f64::log10);
    let counts = || points().map(|p| (p.0 as f64).log10());
    let (low, high) = (times().fold(f64::INFINITY, f64::min).floor(), times().fold(f64::NEG_INFINITY, f64::max).ceil());
    let (first, last) = (counts().fold(f64::INFINITY, f64::min), counts().fold(f64::NEG_INFINITY, f64::max));
    let [left, right, top, bottom] = FRAME;
    let x = |n: usize| {
        if last > first {
            left + ((n as f64).log10() - first) / (last - first) * (right - left)
        } else {
            0.5 * (left + right)
        }
    };
    let y = |t: f64| bottom - (t.log10() - low) / (high - low).max(1.0) * (bottom - top);
    let (width, height) = SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\" fill=\"#333\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n\
         <text x=\"{left}\" y=\"18\" font-weight=\"bold\">{}</text>\n",
        escaped(&format!("{}: time of a horizon, {} cores", report.robot, report.cores))
    );
    let out = &mut svg;
    // Writing to a string cannot fail.
    for decade in low as i32..=high as i32 {
        let at = y(10f64.powi(decade));
        let _ = writeln!(out, "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#ddd\"/>");
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 8.0,
            at + 4.0,
            unit(decade)
        );
    }
    let mut knots: Vec<usize> = points().map(|p| p.0).collect();
    knots.sort_unstable();
    knots.dedup();
    for n in knots {
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{n}</text>", x(n), bottom + 18.0);
    }
    let _ = writeln!(
        out,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">knots</text>",
        0.5 * (left + right),
        bottom + 38.0
    );
    for (k, (name, points)) in curves.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let mut line = |thickness: f64, time: &dyn Fn(&(usize, f64, f64)) -> f64| {
            let path: Vec<String> = points.iter().map(|p| format!("{:.1},{:.1}", x(p.0), y(time(p)))).collect();
            let _ = writeln!(
                out,
                "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{thickness}\" points=\"{}\"/>",
                path.join(" ")
            );
        };
        line(2.0, &|p| p.1);
        line(0.7, &|p| p.2);
        for p in points {
            let _ = writeln!(out, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"{colour}\"/>", x(p.0), y(p.1));
        }
        let at = top + 20.0 * k as f64;
        let _ = writeln!(out, "<path d=\"M{} {at}h22\" stroke=\"{colour}\" stroke-width=\"2\"/>", right + 16.0);
        let _ = writeln!(out, "<text x=\"{}\" y=\"{}\">{}</text>", right + 44.0, at + 4.0, escaped(name));
    }
    if let Some(period) = period {
        let at = y(period);
        let _ = writeln!(out, "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#d1495b\" stroke-dasharray=\"6 4\"/>");
        let _ = writeln!(out, "<text x=\"{}\" y=\"{:.1}\" fill=\"#d1495b\">period</text>", right + 6.0, at + 4.0);
    }
    let note = bottom + 38.0;
    let _ = writeln!(out, "<text x=\"{}\" y=\"{note}\">thick: p50, thin: p99</text>", right + 16.0);
    let _ = writeln!(
        out,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888\"/>\n</svg>",
        right - left,
        bottom - top
    );
    svg
}

fn curves(report: &Report) -> Vec<Curve> {
    let rows = &report.horizons;
    let curve = |name: &str, time: &dyn Fn(&super::dynamics::Row) -> Option<super::clock::Times>| {
        let points: Vec<_> = rows.iter().filter_map(|row| time(row).map(|t| (row.knots, t.p50, t.p99))).collect();
        (name.to_owned(), points)
    };
    let mut curves = vec![
        curve("dynamics, single", &|row| Some(row.single)),
        curve("dynamics, lanes", &|row| Some(row.lanes)),
        curve("dynamics, threads", &|row| row.threads),
    ];
    for kind in ["free", "in contact"] {
        let rows = report.iterations.iter().filter(|row| row.name == kind);
        let points = rows.map(|row| (row.knots, row.best().p50, row.best().p99)).collect();
        curves.push((format!("FDDP, {kind}"), points));
    }
    curves.retain(|(_, points)| !points.is_empty());
    curves
}

/// Formats 10ⁿ s with a unit.
fn unit(decade: i32) -> String {
    let (power, unit) = match decade {
        ..-6 => (decade + 9, "ns"),
        -6..-3 => (decade + 6, "µs"),
        -3..0 => (decade + 3, "ms"),
        0.. => (decade, "s"),
    };
    format!("{} {unit}", 10f64.powi(power))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}
