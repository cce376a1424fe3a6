package vantage.spy;

import javax.swing.SwingUtilities;

/** lcm-spy with the viewer open from the start (scripts/spy --view). */
public final class Main {
    public static void main(String[] words) {
        lcm.spy.Spy.main(words); // Opens its window and returns; ours is to lie above it.
        SwingUtilities.invokeLater(Viewer::open);
    }
}
