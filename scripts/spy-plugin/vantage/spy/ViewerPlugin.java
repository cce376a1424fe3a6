package vantage.spy;

import java.awt.event.ActionEvent;
import javax.swing.AbstractAction;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;
import vantage.completeness_t;
import vantage.image_part_t;

/** Colour, depth and view sphere inside lcm-spy: a right click on one of their channels offers it. */
public final class ViewerPlugin implements SpyPlugin {
    @Override public boolean canHandle(long fingerprint) {
        return fingerprint == image_part_t.LCM_FINGERPRINT || fingerprint == completeness_t.LCM_FINGERPRINT;
    }

    /** lcm-spy asks with nulls as well, for the name. */
    @Override public Action getAction(JDesktopPane desktop, ChannelData channel) {
        return new AbstractAction("Colour, depth and view sphere") {
            @Override public void actionPerformed(ActionEvent event) { Viewer.open(); }
        };
    }
}
