package vantage.spy;

import java.io.IOException;

/** Depth images as lib/rgbd/codec.h writes them: "RVL1", width, height, then numbers of 4-bit pieces, high half of a byte first. */
final class DepthCodec {
    private static final int HEADER = 12;
    private static final int MAX_SIDE = 8192;

    final int width;
    final int height;
    final char[] millimetres; // 0 = none.

    private final byte[] bytes;
    private int next = 2 * HEADER; // In half bytes.

    DepthCodec(byte[] bytes) throws IOException {
        if (bytes.length < HEADER || bytes[0] != 'R' || bytes[1] != 'V' || bytes[2] != 'L' || bytes[3] != '1') {
            throw new IOException("no RVL1 image");
        }
        this.bytes = bytes;
        width = littleEndian(4);
        height = littleEndian(8);
        if (width < 1 || width > MAX_SIDE || height < 1 || height > MAX_SIDE) throw new IOException("depth of " + width + "x" + height);
        millimetres = new char[width * height];
        int at = 0;
        int previous = 0;
        while (at < millimetres.length) {
            int before = at;
            at += run(millimetres.length - at);
            for (int left = run(millimetres.length - at); left > 0; --left) {
                int difference = number();
                previous += (difference >>> 1) ^ -(difference & 1);
                millimetres[at++] = (char) previous;
            }
            if (at == before) throw new IOException("an empty run");
        }
    }

    private int run(int most) throws IOException {
        int length = number();
        if (length < 0 || length > most) throw new IOException("a run past the end");
        return length;
    }

    private int number() throws IOException {
        int value = 0;
        for (int shift = 0; shift < 33; shift += 3) {
            if (next >= 2 * bytes.length) throw new IOException("cut off");
            int piece = next % 2 == 0 ? (bytes[next / 2] >> 4) & 15 : bytes[next / 2] & 15;
            ++next;
            value |= (piece & 7) << shift;
            if ((piece & 8) == 0) return value;
        }
        throw new IOException("a number without end");
    }

    private int littleEndian(int at) {
        return (bytes[at] & 255) | (bytes[at + 1] & 255) << 8 | (bytes[at + 2] & 255) << 16 | (bytes[at + 3] & 255) << 24;
    }
}
