// Lights a Unity scene with an exported light. By formula: not run in the editor by its makers.
//
// 1. Put this file, NAME_unity.json and both .hdr files into Assets. For the .hdr files set
//    Texture Shape = 2D, Wrap Mode = Repeat, Generate Mip Maps off.
//    Copy this file once per project: it is the same for every light, and a second copy does not compile (CS0101).
// 2. Add this component to any object, set Light File to the .json, Full Map to NAME_unity.hdr, Ambient
//    Map to NAME_unity_ambient.hdr and Sun to a directional light, and choose Apply from its menu.
// The camera's front is +Z, up is +Y. Use linear colour space (Project Settings > Player).
//
// With a Sun the sky, and what mirrors it, is Ambient Map: in Full Map the main light would count twice.
// Apply then makes all lights of the project take their intensity as linear (GraphicsSettings).

using System;
using UnityEngine;
using UnityEngine.Rendering;

[ExecuteAlways]
public class AnyprobeLight : MonoBehaviour
{
    [Tooltip("NAME_unity.json")] public TextAsset LightFile;
    [Tooltip("NAME_unity.hdr, imported as a 2D texture; the sky without a Sun")] public Texture FullMap;
    [Tooltip("NAME_unity_ambient.hdr, likewise; the sky with a Sun")] public Texture AmbientMap;
    [Tooltip("A directional light; without one the main light stays in the SH and the sky")] public Light Sun;

    [Serializable]
    class UnityPart
    {
        public float[] sh_full;
        public float[] sh_ambient;
        public float[] light_direction;
        public float[] light_color;
        public float light_intensity;
    }

    [Serializable]
    class Sidecar
    {
        public UnityPart unity;
    }

    void OnEnable()
    {
        if (LightFile != null) Apply();
    }

    [ContextMenu("Apply")]
    public void Apply()
    {
        if (Sun != null && FullMap != null && AmbientMap == null)
        {
            Debug.LogError("AnyprobeLight: expected an Ambient Map beside the Sun, got none; set NAME_unity_ambient.hdr", this);
            return;
        }
        UnityPart light = JsonUtility.FromJson<Sidecar>(LightFile.text).unity;
        float[] sh = Sun != null ? light.sh_ambient : light.sh_full;
        var probe = new SphericalHarmonicsL2();
        for (int channel = 0; channel < 3; channel++)
            for (int i = 0; i < 9; i++)
                probe[channel, i] = sh[channel * 9 + i];
        RenderSettings.ambientMode = AmbientMode.Custom;
        RenderSettings.ambientProbe = probe;

        Texture map = Sun != null ? AmbientMap : FullMap;
        if (map != null)
        {
            var sky = new Material(Shader.Find("Skybox/Panoramic"));
            sky.SetTexture("_MainTex", map);
            sky.SetFloat("_Mapping", 1f);
            sky.EnableKeyword("_MAPPING_LATITUDE_LONGITUDE_LAYOUT");
            sky.SetColor("_Tint", new Color(0.5f, 0.5f, 0.5f, 0.5f)); // its neutral grey
            RenderSettings.skybox = sky;
            RenderSettings.defaultReflectionMode = DefaultReflectionMode.Skybox;
            DynamicGI.UpdateEnvironment(); // reflections of the new sky
        }

        if (Sun != null)
        {
            GraphicsSettings.lightsUseLinearIntensity = true; // else the intensity goes through the sRGB curve
            float[] d = light.light_direction, c = light.light_color;
            Sun.transform.rotation = Quaternion.LookRotation(new Vector3(-d[0], -d[1], -d[2]));
            Sun.color = new Color(c[0], c[1], c[2]).gamma; // lights keep their colour as sRGB
            Sun.useColorTemperature = false; // it would tint the colour
            Sun.intensity = light.light_intensity;
        }
    }
}
