// Maps one mesh onto another:  mono MapHands.exe A.obj B.obj landmarks.txt
// The declarations are those of ism_c.h; Unity calls a native plug-in in the same way.

using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Runtime.InteropServices;

static class Ism {
  const string Library = "ism_c";  // libism_c.so, ism_c.dll or libism_c.dylib
  public const int Done = 0, Unfinished = 6, A = 0, B = 1, Vertex = 0, Double = 1;

  [StructLayout(LayoutKind.Sequential)]
  public struct Mesh {
    public IntPtr Positions, Triangles;
    public int VertexCount, TriangleCount, PositionStride, TriangleStride, PositionType;
  }

  [StructLayout(LayoutKind.Sequential)]
  public struct Landmark {
    public int A, B;
    public double Weight;
    public double A0, A1, A2, B0, B1, B2;  // barycentric; zeros: A and B are vertices
  }

  [UnmanagedFunctionPointer(CallingConvention.Cdecl)]
  public delegate int Progress(IntPtr user, double fraction, IntPtr what);

  [StructLayout(LayoutKind.Sequential)]
  public struct Options {
    public uint Size;
    public int Measure, Boundary, MaxIterations, HistoryLength, Coarsest, Threads, OuterA, OuterB;
    public int KeepScale, ExactLandmarks, Weld, Candidates, AsPublished;
    public double CoverageWeight, Tolerance, Refine, OmegaStart, MaxSeconds;
    public IntPtr PinsA, PinsB;
    public int PinsACount, PinsBCount;
    public Progress Progress;
    public IntPtr User;
  }

  [StructLayout(LayoutKind.Sequential)]
  public struct Message {
    public IntPtr Sentence, Ids;
    public int IdCount;
  }

  [StructLayout(LayoutKind.Sequential)]
  public struct Result {
    public Message Message;
    public IntPtr Warnings;
    public int WarningCount, IterationCount;
    public double Fraction, Distortion, CoverageA, CoverageB, Seconds;
    public int Status;
  }

  [StructLayout(LayoutKind.Sequential)]
  public struct Meta {
    public int VertexCount, PolygonCount, CornerCount;
    public IntPtr OnA, OnB, Plane, FaceA, FaceB, Offsets, Corners, CornerA, CornerB, Distortion;
    public double Mean, Median, P95, Largest, SigmaMin, SigmaMax, AreaA, AreaB;
  }

  [StructLayout(LayoutKind.Sequential)]
  public struct Transfer {
    public int RowCount, SourceCount;
    public IntPtr Offsets, Sources, Weights;
  }

  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_default_options(ref Options options);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern IntPtr ism_last_error();
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_run_create(ref Mesh a, ref Mesh b, Landmark[] landmarks, int n,
                                          ref Options options, out IntPtr run);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_run_advance(IntPtr run, int steps, double seconds);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_run_result(IntPtr run, out Result result);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_run_free(IntPtr run);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_map_create(IntPtr run, out IntPtr map);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern void ism_map_free(IntPtr map);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_map_images(IntPtr map, int from, int n, int[] ids,
                                          double[] barycentric, int[] imageIds,
                                          double[] imageBarycentric, double[] imagePositions);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_map_meta(IntPtr map, out Meta meta);
  [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
  public static extern int ism_map_transfer(IntPtr map, int from, int element, int target,
                                            out Transfer transfer);

  public static string Text(IntPtr text) { return Marshal.PtrToStringAnsi(text); }
}

/// A mesh in arrays that the garbage collector does not move while the library reads them.
class ObjMesh : IDisposable {
  public readonly int VertexCount;
  readonly GCHandle positions, triangles;
  readonly int triangleCount;

  public ObjMesh(string path) {
    var x = new List<double>();
    var f = new List<int>();
    foreach (string line in File.ReadLines(path)) {
      string[] words = line.Split((char[])null, StringSplitOptions.RemoveEmptyEntries);
      if (words.Length != 4) continue;
      for (int k = 1; k < 4; ++k)
        if (words[0] == "v")
          x.Add(Number(words[k]));
        else if (words[0] == "f")
          f.Add(int.Parse(words[k].Split('/')[0]) - 1);
    }
    VertexCount = x.Count / 3;
    triangleCount = f.Count / 3;
    positions = GCHandle.Alloc(x.ToArray(), GCHandleType.Pinned);
    triangles = GCHandle.Alloc(f.ToArray(), GCHandleType.Pinned);
  }

  /// Mono's double.Parse() gets the last bit of some numbers wrong.
  static double Number(string text) {
    return (double)decimal.Parse(text, NumberStyles.Float, CultureInfo.InvariantCulture);
  }

  public Ism.Mesh View() {
    return new Ism.Mesh { Positions = positions.AddrOfPinnedObject(), VertexCount = VertexCount,
                          PositionStride = 3 * sizeof(double), PositionType = Ism.Double,
                          Triangles = triangles.AddrOfPinnedObject(),
                          TriangleCount = triangleCount, TriangleStride = 3 * sizeof(int) };
  }

  public void Dispose() {
    positions.Free();
    triangles.Free();
  }
}

static class MapHands {
  static void Print(string format, params object[] values) {
    Console.WriteLine(string.Format(CultureInfo.InvariantCulture, format, values));
  }

  static Ism.Landmark[] ReadLandmarks(string path) {
    var landmarks = new List<Ism.Landmark>();
    foreach (string line in File.ReadLines(path)) {
      string[] words = line.Split((char[])null, StringSplitOptions.RemoveEmptyEntries);
      int a = 0, b = 0;
      if (words.Length >= 2 && int.TryParse(words[0], out a) && int.TryParse(words[1], out b))
        landmarks.Add(new Ism.Landmark { A = a, B = b, Weight = 8 });
    }
    return landmarks.ToArray();
  }

  static int Show(IntPtr user, double fraction, IntPtr what) {
    Console.Error.Write("\r{0,3:0}%  {1,-40}", 100 * fraction, Ism.Text(what));
    return 1;
  }

  /// Prints where a vertex of A goes; returns false if that is nowhere.
  static bool PrintImage(IntPtr map, int vertex) {
    var triangle = new int[1];
    var p = new double[3];
    if (Ism.ism_map_images(map, Ism.A, 1, new[] { vertex }, null, triangle, null, p) != Ism.Done ||
        triangle[0] < 0)
      return false;
    Print("vertex {0} of A goes to {1:G6} {2:G6} {3:G6} in triangle {4} of B", vertex, p[0], p[1],
          p[2], triangle[0]);
    return true;
  }

  static void PrintMap(IntPtr run, IntPtr map, int vertexCount, Ism.Landmark[] landmarks) {
    Ism.Result result;
    Ism.Meta meta;
    Ism.Transfer transfer;
    Ism.ism_run_result(run, out result);
    for (int i = 0; i < result.WarningCount; ++i) {
      IntPtr place = result.Warnings + i * Marshal.SizeOf(typeof(Ism.Message));
      var warning = (Ism.Message)Marshal.PtrToStructure(place, typeof(Ism.Message));
      Print("warning: {0}", Ism.Text(warning.Sentence));
    }
    Print("distortion: {0:G6} (2 is an isometry)", result.Distortion);
    Print("coverage:   {0:G6} of A, {1:G6} of B", result.CoverageA, result.CoverageB);
    for (int v = 0; v < vertexCount && !PrintImage(map, v);) ++v;
    foreach (Ism.Landmark l in landmarks) PrintImage(map, l.A);
    if (Ism.ism_map_meta(map, out meta) == Ism.Done)
      Print("meta mesh: {0} polygons, distortion {1:G6} in the median, {2:G6} at most",
            meta.PolygonCount, meta.Median, meta.Largest);
    if (Ism.ism_map_transfer(map, Ism.A, Ism.Vertex, Ism.Vertex, out transfer) == Ism.Done)
      Print("transfer: {0} rows, {1} weights", transfer.RowCount,
            Marshal.ReadInt32(transfer.Offsets, transfer.RowCount * sizeof(int)));
  }

  static int Run(ObjMesh a, ObjMesh b, Ism.Landmark[] landmarks) {
    var options = new Ism.Options { Size = (uint)Marshal.SizeOf(typeof(Ism.Options)) };
    Ism.ism_default_options(ref options);
    Ism.Progress show = Show;  // in a variable, so that it lives as long as the run
    options.Progress = show;
    Ism.Mesh viewA = a.View(), viewB = b.View();
    IntPtr run, map = IntPtr.Zero;
    if (Ism.ism_run_create(ref viewA, ref viewB, landmarks, landmarks.Length, ref options,
                           out run) == Ism.Done) {
      Ism.ism_run_advance(run, 0, double.PositiveInfinity);
      Console.Error.WriteLine();
      Ism.ism_map_create(run, out map);
    }
    if (map != IntPtr.Zero)
      PrintMap(run, map, a.VertexCount, landmarks);
    else
      Console.Error.WriteLine(Ism.Text(Ism.ism_last_error()));
    Ism.ism_map_free(map);
    Ism.ism_run_free(run);
    GC.KeepAlive(show);
    return map != IntPtr.Zero ? 0 : 1;
  }

  static int Main(string[] arguments) {
    if (arguments.Length != 3) {
      Console.Error.WriteLine("usage: MapHands.exe A.obj B.obj landmarks.txt");
      return 1;
    }
    using (var a = new ObjMesh(arguments[0]))
      using (var b = new ObjMesh(arguments[1]))
        return Run(a, b, ReadLandmarks(arguments[2]));
  }
}
